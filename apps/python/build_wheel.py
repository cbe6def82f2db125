"""Makes the wheel that `pip install .` installs (PEP 517), with CMake and the standard library alone.

The module is built into ../../build, as scripts/build builds all else there, or into the folder that the environment
variable CAIRN_BUILD names.
"""
import base64
import hashlib
import os
import pathlib
import platform
import re
import subprocess
import sysconfig
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
EXTENSION = "_cairn" + sysconfig.get_config_var("EXT_SUFFIX")


def version():
    return re.search(r"project\(cairn VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text()).group(1)


def metadata():
    return (f"Metadata-Version: 2.1\nName: cairn\nVersion: {version()}\nSummary: Global structure-from-motion\n"
            "License: BSD-3-Clause\nRequires-Python: >=3.11\nRequires-Dist: numpy\n")


def build_module():
    """The package's folder, with the module in it."""
    build = pathlib.Path(os.environ.get("CAIRN_BUILD", ROOT / "build"))
    if not (build / "CMakeCache.txt").exists():
        subprocess.run(["cmake", "-S", ROOT, "-B", build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release"], check=True)
    subprocess.run(["cmake", "--build", build, "--target", "cairn_python"], check=True)
    package = build / "python/cairn"
    if not (package / EXTENSION).exists():
        raise SystemExit(f"{package} has no {EXTENSION}: it was built for another Python than this one")
    return package


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    package = build_module()
    python = "cp" + sysconfig.get_config_var("py_version_nodot")
    tag = f"{python}-{python}-linux_{platform.machine()}"
    info = f"cairn-{version()}.dist-info"
    files = {f"cairn/{name}": (package / name).read_bytes()
             for name in ("__init__.py", "__init__.pyi", "py.typed", EXTENSION)}
    files[f"{info}/METADATA"] = metadata().encode()
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: cairn\nRoot-Is-Purelib: false\nTag: {tag}\n".encode()
    files[f"{info}/LICENSE"] = (ROOT / "LICENSE").read_bytes()
    record = "".join(f"{name},sha256={digest(data)},{len(data)}\n" for name, data in files.items())
    files[f"{info}/RECORD"] = f"{record}{info}/RECORD,,\n".encode()
    name = f"cairn-{version()}-{tag}.whl"
    with zipfile.ZipFile(pathlib.Path(wheel_directory) / name, "w", zipfile.ZIP_DEFLATED) as wheel:
        for path, data in files.items():
            wheel.writestr(zipfile.ZipInfo(path, date_time=(1980, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)
    return name


def digest(data):
    return base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()


def get_requires_for_build_wheel(config_settings=None):
    return []
