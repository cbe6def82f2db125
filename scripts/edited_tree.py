"""A copy of the committed sources that is edited, built and put back: for scripts/ablate and scripts/mutate."""
import pathlib
import shutil
import subprocess
import sys

root = pathlib.Path(__file__).resolve().parent.parent


def run(command, **kwargs):
    return subprocess.run(command, capture_output=True, text=True, **kwargs)


def check_edits(edits):
    """Ends the program: with 0 where each (file, text) is in the working tree once, else with 1 and those that are not."""
    problems = []
    for name, before in edits:
        path = root / name
        count = path.read_text().count(before) if path.exists() else 0
        if count != 1:
            problems.append(f"{name} has {count} times: {before}")
    print("\n".join(problems) or f"{len(edits)} edits find their text")
    sys.exit(bool(problems) or not edits)


class EditedTree:
    """The sources in OUT/tree, their build in OUT/build (with the compiler cache, where there is one)."""

    def __init__(self, out):
        self.tree, self.build_folder = out / "tree", out / "build"
        self.before_edits = {}
        shutil.rmtree(self.tree, ignore_errors=True)
        self.tree.mkdir(parents=True)
        archive = subprocess.run(["git", "-C", root, "archive", "HEAD"], capture_output=True, check=True).stdout
        # Times of now: those of the commit would look older than what an earlier run has built.
        subprocess.run(["tar", "-x", "--touch", "-C", self.tree], input=archive, check=True)
        configured = run(["cmake", "-S", self.tree, "-B", self.build_folder, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
                          "-DCAIRN_BENCHMARKS=ON"])
        if configured.returncode:
            sys.exit(configured.stdout + configured.stderr)

    def edit(self, name, before, after):
        """Replaces one text of a file; ends the program where it is not there."""
        text = (self.tree / name).read_text()
        if before not in text:
            sys.exit(f"{name} no longer has: {before}")
        self.before_edits.setdefault(name, text)
        (self.tree / name).write_text(text.replace(before, after, 1))

    def restore(self):
        for name, text in self.before_edits.items():
            (self.tree / name).write_text(text)
        self.before_edits = {}

    def build(self, *targets):
        """"" or what the compiler said."""
        built = run(["ninja", "-C", self.build_folder, *targets])
        return built.stdout[-3000:] if built.returncode else ""
