"""The residual loop: find what a model leaves over, trace it to an effect the model lacks, add it, measure again."""
