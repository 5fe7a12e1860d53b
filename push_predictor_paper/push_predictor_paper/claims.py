# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The claims of the paper, and what each requires of the figures that its section measures.

The sections of the report (`sections/`) measure the figures. They are in SI units or in the unit given.
"""

from __future__ import annotations

from push_predictor_paper.verdict import Bound, Claim

LEAST_WINDOWS = 10  # at every speed, of every set
PAPER_SETS = 16
PAPER_SIZE = 100  # training windows from about which both learned models lead
ENOUGH = 1000  # training windows below which the paper sees performance saturate
TURN = (0.05, 0.08)  # m/s, the top speed at which the paper's models are best
SD_KNOWN = 0.25  # half-width of the interval of a standard deviation, as a share of it
LEVEL = 0.05  # of the tests for modes
POSITIVE, NEGATIVE = Bound(low=0.0, strict=True), Bound(high=0.0, strict=True)
SOME = Bound(low=1.0)  # of a count

CLAIMS: dict[str, dict[str, Claim]] = {  # by section of the report
    "data": {
        "sets": Claim(
            "Pushes at 10 to 500 mm/s of four shapes on four surfaces to learn from",
            "section III",
            "Sets of shape and surface, and windows in the poorest set and speed",
            Bound(low=PAPER_SETS),
            form=".0f",
        ),
        "known": Claim(
            "Repeated pushes determine the mean and the standard deviation of each push",
            "section III",
            "Share of the pushes whose three standard deviations are known to 25 %",
            Bound(0.9, 1.0),
            Bound(0.5, 1.0),
            form=".0%",
        ),
    },
    "kinds_of_push": {
        "growth": Claim(
            "Some repeated pushes are convergent (their paths draw together), others divergent (they fan out)",
            "figure 1",
            "Relative spread of the paths at the end over that half-way",
            Bound(high=1.0),
        ),
        "apart": Claim(
            "Divergent pushes end further apart than convergent ones",
            "figure 1",
            "Spread of the final poses, most divergent over most convergent push",
            Bound(low=2.0),
            Bound(low=1.0),
        ),
        "modes": Claim(
            "Some repeated pushes are multi-modal",
            "figure 1",
            "Pushes whose final poses have more than one mode (dip test, 5 % family-wise)",
            SOME,
            form=".0f",
        ),
    },
    "maps": {
        "forward": Claim(
            "The slider moves farthest forward when pushed at the middle of a side, along its normal",
            "figure 5",
            "Distance of the largest |dx| from the paper's push in steps of the grid, and |dx| there over the largest",
            Bound(low=0.9),
            paper="c = 0.5, 0°",
        ),
        "sideways": Claim(
            "The slider moves far sideways when pushed at c = 0.7, β = 40° (the paper's signs)",
            "figure 5",
            "|dy| at the paper's push over the largest",
            Bound(low=0.9),
            Bound(low=0.75),
        ),
        "turning": Claim(
            "The slider turns most when pushed between middle and corner, at c = 0.75, β = +30° or c = 0.25, β = −30° "
            "(the paper's signs)",
            "figure 5",
            "Distance of the largest |rotation| from the paper's push in steps of the grid, and that there over the "
            "largest",
            Bound(low=0.9),
        ),
        "handedness": Claim(
            "Between middle and corner, a push that leads away from the middle turns the slider more (the paper's "
            "handedness)",
            "figure 5",
            "|rotation| at c = 0.75, −30° minus that at +30° (our signs; mean with c = 0.25 mirrored)",
            POSITIVE,
            unit="deg",
        ),
        "mean_map": Claim(
            "The model's map of the mean agrees well with that of the repetitions",
            "figures 5 and 6",
            "Correlation of VHGP and repetitions over the pushes",
            Bound(low=0.9),
            paper="remarkably similar",
        ),
        "sd_map": Claim(
            "The model's map of the standard deviation agrees to a certain degree with that of the repetitions",
            "figures 5 and 6",
            "Correlation of VHGP and repetitions over the pushes",
            Bound(low=0.5),
            paper="well matched to a certain degree",
        ),
    },
    "noise": {
        "size": Claim(
            "The noise is 10 to 40 % of the expected output",
            "section V, figure 6",
            "Root mean square of the sd over that of the mean, and share of the pushes with 10 to 40 % of the whole "
            "motion",
            Bound(0.1, 0.4),
            form=".0%",
        ),
        "span": Claim(
            "The noise varies by up to an order of magnitude over the pushes",
            "section V, figure 6",
            "95th over 5th percentile of the sd, of the output where it is widest",
            Bound(10.0**0.5, 10.0**1.5),
            form=".1f",
        ),
        "shape": Claim(
            "The shape of the noise is the same on different surfaces",
            "section V, figure 6",
            "Correlation of log sd between surfaces over the pushes, the least of all pairs of surfaces",
            Bound(low=0.7),
            Bound(low=0.3),
        ),
    },
    "learning_curves": {
        "circle": Claim(
            "The circle is easier to learn than the other shapes",
            "figure 8",
            "Score of the other shape minus that of the circle",
            POSITIVE,
            form=".3f",
        ),
        "surface": Claim(
            "The model is not very sensitive to the surface",
            "figure 7",
            "Spread of the score over surfaces divided by that over shapes",
            Bound(high=0.5),
            Bound(high=1.0),
        ),
        "saturation": Claim(
            f"Performance saturates below {ENOUGH} samples",
            "figures 7 and 8",
            "Gain of the last doubling of the training windows: share of the NMSE, and nats of the NLPD",
            Bound(high=0.1),
        ),
    },
    "comparison": {
        "early": Claim(
            f"GP and VHGP beat the analytical model from about {PAPER_SIZE} samples",
            "figure 9",
            "Training windows from which the NMSE stays below the analytical model's",
            Bound(high=1.5 * PAPER_SIZE),
            form=".0f",
        ),
        "better": Claim(
            "The learned models predict better than the analytical one",
            "figure 9, table I",
            "NMSE minus that of the analytical model",
            NEGATIVE,
            form=".3f",
            paper="−0.34; −0.35",
        ),
        "similar": Claim(
            "GP and VHGP have a similar NMSE",
            "figure 9, table I",
            "NMSE of the VHGP over that of the GP",
            Bound(0.9, 1.1),
            Bound(0.8, 1.2),
            paper="0.97",
        ),
        "density": Claim(
            "The VHGP beats the GP in NLPD",
            "figure 9, table I",
            "NLPD of the VHGP minus that of the GP",
            NEGATIVE,
            unit="nats",
            paper="−0.91",
        ),
        "mean_gain": Claim(
            "Input-dependent noise improves the mean too",
            "section IV, table I",
            "NMSE of the VHGP minus that of the GP",
            NEGATIVE,
            form=".3f",
            paper="−0.01",
        ),
    },
    "speed_error": {
        "unreliable": Claim(
            "The analytical model is less reliable at high speed",
            "section VI-B",
            "Rank correlation over pushes of speed and squared error in units of the variance at that speed",
            Bound(low=0.1),
        ),
        "captured": Claim(
            "Models with the speed as an input capture the dynamic effects",
            "section VI-B",
            "NMSE of the VHGP minus that of the analytical model within each speed from 100 mm/s on",
            NEGATIVE,
        ),
    },
    "divergence": {
        "mean": Claim(
            "The VHGP is closer to the distributions of repeated pushes than the GP, in mean KL",
            "table II",
            "Mean KL of the VHGP minus that of the GP, paired over the pushes",
            NEGATIVE,
            paper="15.32 minus 22.63",
        ),
        "median": Claim(
            "The VHGP is closer to the distributions of repeated pushes than the GP, in median KL",
            "table II",
            "Median KL of the VHGP minus that of the GP, paired over the pushes",
            NEGATIVE,
            paper="5.34 minus 5.74",
        ),
        "good": Claim(
            "The VHGP predicts the distribution of a push reasonably well",
            "table II",
            "Median KL of the VHGP; with exact means it is 0.95 with sds twice too wide, 2.42 with sds half as wide",
            Bound(high=0.95),
            Bound(high=2.42),
            paper="5.34",
        ),
    },
    "modality": {
        "modes": Claim(
            "Some repeated pushes have outcomes with more than one mode",
            "figure 10",
            "Pushes with more than one mode in some output (dip test, 5 % family-wise)",
            SOME,
            form=".0f",
        ),
        "not_gaussian": Claim(
            "The outcomes of some repeated pushes are not Gaussian",
            "figure 10",
            "Pushes with an output that is not Gaussian (Shapiro and Wilk, 5 % family-wise)",
            SOME,
            form=".0f",
        ),
        "gaussian_good": Claim(
            "The VHGP's Gaussian approximates even pushes with several modes well",
            "figure 10",
            "Log density that the VHGP's Gaussian loses to the one or two Gaussians fitted to the push itself; 0.32 "
            "is the cost of an sd twice too wide",
            Bound(high=0.16),
            Bound(high=0.32),
            unit="nats",
        ),
    },
    "quasi_static": {
        "course": Claim(
            "Adding faster pushes to a model without the speed as an input first helps, then harms",
            "figure 11",
            "NMSE of the VHGP on held-out pushes of its own speeds, minus that of the bracket up to the paper's turn",
            POSITIVE,
            form=".3f",
        ),
        "turn": Claim(
            "A model without the speed as an input is best with pushes of up to 50 to 80 mm/s",
            "figure 11",
            "Top speed of the training pushes with the lowest NMSE of the VHGP",
            Bound(1e3 * TURN[0], 1e3 * TURN[1]),
            form=".0f",
            unit="mm/s",
        ),
        "beyond": Claim(
            "The quasi-static assumption does not hold beyond 50 to 80 mm/s",
            "figure 11",
            "Departure of the outcome from that of the slowest pushes over the error of the slowest VHGP; 10 % is "
            "notable",
            Bound(low=0.1),
            form=".0%",
        ),
        "speed_input": Claim(
            "The speed is a useful input",
            "section VI-B",
            "NMSE of the VHGP with the speed as an input minus that without it, same windows of all speeds",
            NEGATIVE,
            form=".3f",
        ),
    },
}
