# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The ROS package push_predictor (ament_python), installable by pip and by colcon alike."""

import os
import sys
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from glob import glob
from pathlib import Path

from setuptools import Extension, find_packages, setup
from setuptools.command.build_ext import build_ext

NAME = "push_predictor"
NODES = ("predict_server", "push_recorder", "push_replay", "push_validator")
COMPILED = (  # below push_predictor: Python files that Cython translates to C
    "geometry/boundary",
    "models/mechanics/kernel/surface",
    "models/mechanics/kernel/contact",
    "models/mechanics/kernel/sweep",
    "models/mechanics/kernel/push",
    "models/tabulated/spline",
)
NO_CYTHON = "setup.py: Cython 3 is needed to build: apt install cython3, or pip install 'Cython>=3.0'"


class BuildCompiled(build_ext):
    """Translates and compiles. Only this step imports Cython: --version, egg_info and colcon's look do without."""

    def build_extensions(self):
        """Compile with all cores while the next file is translated."""
        with ThreadPoolExecutor(self.parallel or len(os.sched_getaffinity(0))) as pool:
            jobs = [pool.submit(self.build_extension, self.translated(each)) for each in self.extensions]
        for job in jobs:
            job.result()

    def translated(self, extension):
        """Return the same extension in C. The C file is written into the folder of temporary files."""
        in_c = Path(self.build_temp, extension.sources[0]).with_suffix(".c")
        if self.force or not in_c.exists() or in_c.stat().st_mtime < newest_source():
            language = {"language_level": 3}
            cythonize()(
                [extension], build_dir=self.build_temp, compiler_directives=language, force=self.force, quiet=True
            )
        result = copy(extension)  # the original lists the files of a source distribution
        result.sources = [str(in_c)]
        return result


def newest_source():
    """Time of the last change of a compiled file. Cython also looks at its own files, which are new for each pip."""
    paths = [Path(NAME, f"{name}{end}") for name in COMPILED for end in (".py", ".pxd")]
    return max(path.stat().st_mtime for path in paths if path.exists())


def cythonize():
    """Return Cython's function of this name, or end with one line where there is none of version 3."""
    try:
        import Cython.Build
    except ImportError:
        sys.exit(NO_CYTHON)
    if int(Cython.__version__.split(".")[0]) < 3:
        sys.exit(f"{NO_CYTHON} (found: {Cython.__version__})")
    return Cython.Build.cythonize


def extension(name):
    """The extension module of one compiled file: no -march, no -ffast-math, so that all machines agree."""
    path = f"{NAME}/{name}"
    return Extension(path.replace("/", "."), [f"{path}.py"], extra_compile_args=["-O3", "-g0"])


setup(
    name=NAME,
    version="0.1.0",
    description="Learned and analytical models of planar pushing for ROS 2",
    long_description=Path(__file__).resolve().with_name("README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    author="push_predictor founders",
    license="Apache-2.0",
    keywords=["robotics", "ROS 2", "planar pushing", "manipulation", "Gaussian process"],
    classifiers=[
        "Development Status :: 4 - Beta",
        "Intended Audience :: Science/Research",
        "Operating System :: POSIX :: Linux",
        "Programming Language :: Python :: 3",
        *(f"Programming Language :: Python :: 3.{minor}" for minor in range(10, 14)),
        "Topic :: Scientific/Engineering",
        "Typing :: Typed",
    ],
    python_requires=">=3.10",
    packages=find_packages(include=["push_predictor", "push_predictor.*", "msg_adapters", "msg_adapters.*"]),
    package_data={"push_predictor": ["py.typed", "reporting/templates/*"]},
    ext_modules=[extension(name) for name in COMPILED],
    cmdclass={"build_ext": BuildCompiled},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", glob("launch/*.launch.py")),
        (f"share/{NAME}/config", glob("config/*")),
        (f"share/{NAME}/resource", glob("resource/*.pushmodel*")),
        # pip puts the executables into bin/ only; `ros2 run` looks here
        (f"lib/{NAME}", [f"scripts/run/{executable}" for executable in (NAME, *NODES)]),
    ],
    install_requires=[
        "numpy>=1.24",
        "scipy>=1.10",
        "mcap>=1.1",
        "lz4>=4",
        "zstandard>=0.22",
        "PyYAML>=5.4",
        "threadpoolctl>=3",
    ],
    extras_require={
        "report": ["matplotlib>=3.6", "jinja2>=3.1"],
        "live": ["rich>=13"],
        "completion": ["argcomplete>=3"],
        "gym": ["gymnasium>=1.1"],
        "import": ["rosbags>=0.10", "h5py>=3.10"],
        "docs": ["mkdocs>=1.6,<2", "mkdocs-material>=9.5,<10", "mkdocstrings[python]>=0.27", "ruff>=0.6"],
        "test": [
            "catkin_pkg>=1",
            "Cython>=3.0",
            "pytest>=8",
            "pytest-xdist>=3.5",
            "hypothesis>=6",
            "ruff>=0.6",
            "mypy>=1.11",
            "scikit-learn>=1.4",
            "mcap-ros2-support>=0.5",
            "argcomplete>=3",
        ],
    },
    entry_points={
        "console_scripts": [
            f"{NAME} = push_predictor.cli:main",
            *(f"{node} = push_predictor.nodes.entry:{node}" for node in NODES),
        ]
    },
    zip_safe=False,
)
