"""Models of one push: Gaussian process, variational heteroscedastic GP, analytical."""
