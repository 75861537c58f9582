# SPDX-License-Identifier: BSD-3-Clause
"""The Python module as a wheel: CMake builds it, setuptools packs it together with its type stubs.

Metadata stand here and not in pyproject.toml, where the setuptools of Ubuntu 22.04 does not look for them.
"""
import pathlib
import re
import subprocess
import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = pathlib.Path(__file__).resolve().parent
BUILD = ROOT / "build/wheel"


class CMakeBuild(build_ext):
    def build_extension(self, extension):
        folder = pathlib.Path(self.get_ext_fullpath(extension.name)).resolve().parent
        subprocess.run(["cmake", "--preset", "wheel", "-S", ROOT, f"-DPython3_EXECUTABLE={sys.executable}",
                        f"-DCMAKE_LIBRARY_OUTPUT_DIRECTORY={folder}"], cwd=ROOT, check=True)
        subprocess.run(["cmake", "--build", BUILD, "--target", "evpose_python"], check=True)


def version():
    return re.search(r"project\(evpose VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text())[1]


BUILD.mkdir(parents=True, exist_ok=True)
setup(
    name="evpose",
    version=version(),
    description="6-DoF pose from an event camera and an IMU against a prior 3D map",
    long_description=(ROOT / "README.md").read_text(),
    long_description_content_type="text/markdown",
    license="BSD-3-Clause",
    license_files=["LICENSE"],
    python_requires=">=3.10",
    install_requires=["numpy"],
    packages=["evpose-stubs"],
    package_dir={"evpose-stubs": "python/evpose-stubs"},
    package_data={"evpose-stubs": ["*.pyi"]},
    ext_modules=[Extension("evpose", [])],
    cmdclass={"build_ext": CMakeBuild},
    zip_safe=False,
    options={"build": {"build_base": "build/wheel/setuptools"}, "egg_info": {"egg_base": "build/wheel"}},
)
