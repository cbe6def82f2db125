#!/usr/bin/python3
"""Looks at reports of `global_sfm` in headless Chromium, as a person would: loads, clicks, resizes.

usage: report_browser_test.py GLOBAL_SFM SCENE_FOLDER [unittest arguments]
SCENE_FOLDER is the rendered scene of the integration tests, with its database. Exit code 77: there is no browser here.
"""
import json
import os
import pathlib
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "support"))
from browser import Browser  # noqa: E402

PROGRAM, SCENE = (pathlib.Path(path).resolve() for path in sys.argv[1:3])

# Share of the canvas's pixels that are not white.
INK = """
  const source = document.querySelector(arguments[0]);
  const copy = document.createElement("canvas");
  copy.width = source.width;
  copy.height = source.height;
  const context = copy.getContext("2d");
  context.drawImage(source, 0, 0);
  const data = context.getImageData(0, 0, copy.width, copy.height).data;
  let ink = 0;
  for (let i = 0; i < data.length; i += 4) ink += data[i] + data[i + 1] + data[i + 2] < 740;
  return ink / (data.length / 4);
"""
# Where camera k of the 3D view is on its canvas, pixels.
CAMERA_AT = """
  const view = window.cairnView, camera = view.camera, canvas = document.querySelector("#view-canvas");
  const at = view.centers[arguments[0]].clone().project(camera);
  return [(at.x + 1) / 2 * canvas.clientWidth, (1 - at.y) / 2 * canvas.clientHeight];
"""


def run(*arguments):
    return subprocess.run([str(PROGRAM), *map(str, arguments)], capture_output=True, text=True)


class ReportTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="cairn_report_"))
        cls.made = cls.reconstruct(SCENE / "scene.db", "model")
        cls.browser = Browser(1400, 900).__enter__()

    @classmethod
    def tearDownClass(cls):
        cls.browser.__exit__()
        shutil.rmtree(cls.folder)

    @classmethod
    def reconstruct(cls, database, name, *others):
        return run("reconstruct", "--database_path", database, "--image_path", SCENE / "images", "--output_path", cls.folder / name,
                   "--num_threads", 1, *others)

    def setUp(self):
        self.browser.resize(1400, 900)

    def open(self, path):
        self.browser.log()
        self.browser.open(path)
        self.wait_for_frames()

    def wait_for_frames(self):
        self.browser.run("return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")

    def assertNoErrors(self):
        self.assertEqual([message["message"] for message in self.browser.log() if message["level"] in ("SEVERE", "WARNING")
                          and "GPU stall" not in message["message"]], [])

    def text(self, selector):
        return self.browser.run("return document.querySelector(arguments[0]).innerText", selector)

    def ink(self, selector):
        return self.browser.run(INK, selector)

    def test_shows_the_scene(self):
        self.assertEqual(self.made.returncode, 0, self.made.stderr)
        self.open(self.folder / "model/report.html")
        self.assertIn("8 of 10 photos in 1 model", self.text("#lead"))
        self.assertIn("2 photos are in no model", self.text("#findings"))
        self.assertIn("other", self.text("#findings"))
        self.assertNotIn("No problem was found", self.text("#findings"))
        self.browser.wait_for("return document.querySelector('#pair-canvas').dataset.drawn !== undefined")
        for canvas, least in (("#view-canvas", 0.001), ("#matrix", 0.2), ("#pair-canvas", 0.5), ("#lenses canvas", 0.1)):
            self.assertGreater(self.ink(canvas), least, canvas)
        self.assertGreater(self.browser.run("return document.querySelectorAll('#histograms rect').length"), 40)
        self.assertEqual(self.browser.run("return document.querySelectorAll('#photo-grid img').length"), 10)
        self.assertIn("bundle adjustment", self.text("#timeline"))
        self.assertIn("GiB", self.text("#timeline"))
        self.assertNoErrors()

    def test_pairs_can_be_looked_at(self):
        self.open(self.folder / "model/report.html")
        self.browser.wait_for("return document.querySelector('#pair-canvas').dataset.drawn !== undefined")
        before = self.text("#pair-title")
        self.browser.click("#pair-controls button:nth-of-type(2)")
        self.assertNotEqual(self.text("#pair-title"), before)
        # The pair of the first row and the third column of the matrix.
        cell = self.browser.run("return matrix.cell")
        names = self.browser.run("return [0, 2].map((k) => images[matrix.order[k]].name).sort()")
        self.browser.click_at("#matrix", 2.5 * cell, 0.5 * cell)
        self.assertEqual(sorted(self.text("#pair-title").split(" – ")), names)
        self.assertIn("inliers", self.text("#pair-facts"))
        # Without its inliers, the drawing changes; without pairs in use, the matrix does.
        with_lines = self.browser.run("return document.querySelector('#pair-canvas').toDataURL()")
        self.browser.click("#pair-controls label:nth-of-type(1) input")
        self.browser.wait_for("return document.querySelector('#pair-canvas').toDataURL().length > 0")
        self.browser.wait_for(f"return document.querySelector('#pair-canvas').toDataURL() !== {json.dumps(with_lines)}")
        before = self.ink("#matrix")
        self.browser.click("#states label:nth-of-type(1) input")
        self.assertLess(self.ink("#matrix"), before)
        self.assertNoErrors()

    def test_the_3d_view_answers(self):
        self.open(self.folder / "model/report.html")
        self.browser.run("document.querySelector('#scene').scrollIntoView()")
        x, y = self.browser.run(CAMERA_AT, 3)
        self.browser.move_to("#view-canvas", x, y)
        self.browser.wait_for("return !document.querySelector('#view-tip').hidden")
        self.assertIn(".jpg", self.text("#view-tip"))
        edges = "return window.cairnView.edges.geometry.attributes.position.count"
        self.assertEqual(self.browser.run(edges), 0)
        self.browser.click("#edge-controls label:nth-of-type(1) input")
        self.assertGreater(self.browser.run(edges), 10)
        x, y = self.browser.run(CAMERA_AT, 3)
        self.browser.click_at("#view-canvas", x, y)
        self.browser.wait_for("return window.cairnView.flownTo !== undefined")
        before = self.ink("#view-canvas")
        self.browser.click("#scene-controls input")
        self.browser.wait_for("return !window.cairnView.points.visible")
        self.wait_for_frames()
        self.assertLess(self.ink("#view-canvas"), before)
        self.assertNoErrors()

    def test_fits_a_phone(self):
        self.browser.resize(390, 844)
        self.open(self.folder / "model/report.html")
        self.assertEqual(self.browser.run("return document.documentElement.scrollWidth"), 390)
        self.assertNoErrors()

    def test_names_are_text(self):
        database = self.folder / "names.db"
        shutil.copy(SCENE / "scene.db", database)
        name = "</script><b>x</b><img src=x onerror=document.title='run'>.jpg"
        with sqlite3.connect(database) as connection:
            connection.execute("UPDATE images SET name = ? WHERE image_id = 1", (name,))
        connection.close()
        self.assertEqual(self.reconstruct(database, "names").returncode, 0)
        self.open(self.folder / "names/report.html")
        self.assertIn(name, self.browser.run("return document.querySelector('#photo-grid').textContent"))
        self.assertEqual(self.browser.run("return document.querySelectorAll('main b').length"), 0)
        self.assertNotEqual(self.browser.run("return document.title"), "run")
        self.assertNoErrors()

    def test_a_failed_run_shows_why(self):
        made = self.reconstruct(SCENE / "scene.db", "failed", "--view_graph.min_num_inliers", 100000)
        self.assertEqual(made.returncode, 1)
        self.assertIn("report.html", made.stdout)
        self.open(self.folder / "failed/report.html")
        self.assertIn("No model came of 10 photos", self.text("#lead"))
        self.assertIn("lower --view_graph.min_num_inliers", self.text("#findings").lower())
        self.assertTrue(self.browser.run("return document.querySelector('#scene').hidden"))
        self.assertGreater(self.ink("#matrix"), 0.1)
        self.assertNoErrors()

    def test_a_collection_and_its_failed_run(self):
        shared = pathlib.Path(os.environ.get("CAIRN_SHARED_DIR", HERE.parents[2] / "shared"))
        images = shared / "data/temple_ring/images"
        if not images.exists():
            self.skipTest(f"{images} is not there")
        database = self.folder / "collection.db"
        build = [PROGRAM.parent / "build_view_graph", "--image_path", images, "--database_path", database, "--single_camera",
                 "--camera_model", "PINHOLE", "--camera_params", "1520.4,1525.9,302.82,247.37"]
        subprocess.run(build, check=True, capture_output=True)
        for name, others in (("collection", []), ("collection_failed", ["--view_graph.min_num_inliers", 100000])):
            made = run("reconstruct", "--database_path", database, "--image_path", images, "--output_path", self.folder / name, *others)
            self.open(self.folder / name / "report.html")
            self.assertEqual(self.browser.run("return document.querySelectorAll('#photo-grid img').length"), 19)
            self.assertEqual(made.returncode, 1 if others else 0)
            self.assertIn("No model came of 19 photos" if others else "19 of 19 photos in 1 model", self.text("#lead"))
            self.assertGreater(self.ink("#matrix"), 0.1)
            self.assertEqual(self.browser.run("return document.querySelector('#scene').hidden"), bool(others))
            if not others:
                self.assertGreater(self.ink("#view-canvas"), 0.001)
            self.assertNoErrors()

    def test_without_three_the_rest_is_there(self):
        page = self.folder / "without.html"
        made = run("report", "--model_path", self.folder / "model/sparse/0", "--output_path", page, "--three_path", "/nonexistent")
        self.assertEqual(made.returncode, 0, made.stderr)
        self.assertIn("libjs-three", made.stderr)
        self.open(page)
        self.assertIn("libjs-three", self.text("#scene"))
        self.assertGreater(self.ink("#matrix"), 0.2)
        self.assertNoErrors()

    def test_the_same_page_comes_from_the_folder(self):
        """But for the path that the model was written to, and times."""
        pages = []
        for threads in (1, 4):
            page = self.folder / f"again{threads}.html"
            made = run("report", "--database_path", SCENE / "scene.db", "--model_path", self.folder / "model", "--output_path", page,
                       "--num_threads", threads)
            self.assertEqual(made.returncode, 0, made.stderr)
            pages.append(page.read_bytes())
        self.assertEqual(pages[0], pages[1])

    def test_report_0_leaves_it_out(self):
        shutil.copytree(self.folder / "model", self.folder / "second")
        made = self.reconstruct(SCENE / "scene.db", "second", "--report", 0)
        self.assertEqual(made.returncode, 0, made.stderr)
        self.assertFalse((self.folder / "second/report.html").exists())
        self.assertNotIn("report.html", made.stdout)

    def test_the_end_is_ten_lines(self):
        lines = self.made.stdout.splitlines()
        self.assertLessEqual(len(lines), 10, self.made.stdout)
        for word in ("models", "photos", "points", "error", "confidence", "warnings", "files", "report"):
            self.assertEqual(sum(line.startswith(word) for line in lines), 1, self.made.stdout)


if __name__ == "__main__":
    if not shutil.which("chromedriver") or not shutil.which("chromium"):
        print("skipped: no chromium-driver")
        sys.exit(77)
    unittest.main(argv=[sys.argv[0]] + sys.argv[3:], verbosity=2)
