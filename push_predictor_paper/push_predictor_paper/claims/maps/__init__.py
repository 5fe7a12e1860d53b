"""Claims about maps of mean and standard deviation over contact and angle.

Import `maps.section`; `map_peaks` is shared with the noise claims.
"""
