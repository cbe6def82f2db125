"""`pip install .` without a network, of what is built already."""
import os
import pathlib
import subprocess
import sys

import pytest

CHECKOUT = pathlib.Path(__file__).resolve().parents[2]


def test_pip_installs_what_imports_beside_opencv(tmp_path):
    assert (CHECKOUT / "pyproject.toml").exists(), "scripts/install_deps links it"
    environment = {**os.environ, "PIP_NO_INDEX": "1", "PYTHONPATH": ""}
    pip = [sys.executable, "-m", "pip", "install", "--no-deps", "--target", tmp_path, CHECKOUT]
    run = subprocess.run(pip, capture_output=True, text=True, env=environment)
    assert run.returncode == 0, run.stdout + run.stderr
    pytest.importorskip("cv2")
    code = ("import cv2, numpy; import cairn; print(cairn.__file__, cairn.__version__); "
            "print(cairn.average_rotations([[1, 2]], [numpy.eye(3)]).status)")
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path,
                         env={**environment, "PYTHONPATH": str(tmp_path)})
    assert run.stdout.startswith(str(tmp_path / "cairn/__init__.py")), run.stderr
    assert run.stdout.endswith("success\n")
    assert (tmp_path / "cairn/__init__.pyi").exists() and (tmp_path / "cairn/py.typed").exists()
