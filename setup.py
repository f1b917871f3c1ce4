"""Only the version lives here: it comes from the manifest, the one place where it stands."""

import tomllib
from pathlib import Path

from setuptools import setup

setup(version=tomllib.loads(Path(__file__).with_name("blender_manifest.toml").read_text("utf-8"))["version"])
