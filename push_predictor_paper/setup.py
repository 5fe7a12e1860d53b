# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The ROS package push_predictor_paper (ament_python): the tables of Bauza and Rodriguez 2017 reproduced."""

from setuptools import find_packages, setup

NAME = "push_predictor_paper"

setup(
    name=NAME,
    version="0.1.0",
    description="Reproduces the results of Bauza and Rodriguez (ICRA 2017) with push_predictor",
    author="push_predictor founders",
    license="Apache-2.0",
    python_requires=">=3.10",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["push_predictor[report]", "joblib>=1.4", "diptest>=0.9"],
    zip_safe=False,
)
