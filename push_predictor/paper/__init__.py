"""What Bauza and Rodriguez 2017 report, claim by claim, on simulated and on measured pushes."""
