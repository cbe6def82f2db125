"""Long calls: the interpreter's lock, Ctrl-C, progress, messages."""
import contextlib
import logging
import os
import signal
import sqlite3
import subprocess
import sys
import threading
import time

import pytest

import cairn
import scene


@pytest.fixture(scope="module")
def database(tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "scene.db"
    # All matches are wrong: some seconds of five points.
    scene.Scene(num_images=10, num_points=400).write(path, num_wrong=400)
    return path


def test_other_threads_run_meanwhile(database, tmp_path):
    path = tmp_path / "scene.db"
    path.write_bytes(database.read_bytes())
    count, done = [0], threading.Event()

    def tick():
        while not done.is_set():
            count[0] += 1
            time.sleep(0.001)

    ticker = threading.Thread(target=tick)
    ticker.start()
    begin = time.monotonic()
    cairn.build_view_graph(path, num_threads=1)
    seconds = time.monotonic() - begin
    done.set()
    ticker.join()
    assert count[0] > 30 * seconds  # without the lock's release, none


INTERRUPTED = """
import sys, cairn
try:
    print("begin", flush=True)
    cairn.build_view_graph(sys.argv[1], num_threads=1)
except KeyboardInterrupt:
    print("interrupted")
"""


def num_verified(path):
    with contextlib.closing(sqlite3.connect(path, timeout=10)) as database:
        tables = database.execute("SELECT COUNT(*) FROM sqlite_master WHERE name = 'cairn_pair_metrics'")
        if tables.fetchone()[0] == 0:
            return 0
        return database.execute("SELECT COUNT(*) FROM cairn_pair_metrics").fetchone()[0]


def test_ctrl_c_stops_and_the_work_continues(database, tmp_path):
    path = tmp_path / "scene.db"
    path.write_bytes(database.read_bytes())
    process = subprocess.Popen([sys.executable, "-c", INTERRUPTED, path], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "begin\n"
    while num_verified(path) == 0:
        assert process.poll() is None
        time.sleep(0.02)
    # No callback: nothing but the call itself can notice it.
    process.send_signal(signal.SIGINT)
    output = process.communicate(timeout=120)[0]
    assert process.returncode == 0 and output.endswith("interrupted\n")
    done = []
    report = cairn.build_view_graph(path, progress=lambda *stage: done.append(stage))
    assert sum(report.rejected_by.values()) == 45
    assert 0 < max(total for name, _, total in done if "verifying" in name) < 45


ENDS = {"build": """
import sys, threading, time, cairn
threading.Thread(target=cairn.build_view_graph, args=[sys.argv[1]], daemon=True).start()
time.sleep(0.5)
""", "calls": """
import threading, time, cairn, numpy as np
camera, (x1, x2) = cairn.Camera.create(1, "PINHOLE", 500, 640, 480), np.random.default_rng(0).uniform(0, 600, (2, 500, 2))
def verify():
    while True:
        cairn.verify_pair(camera, x1, camera, x2, verifier="five_point")
for _ in range(3):
    threading.Thread(target=verify, daemon=True).start()
time.sleep(0.5)
""", "fork": """
import os, sys, threading, time, cairn
threading.Thread(target=cairn.build_view_graph, args=[sys.argv[1]], daemon=True).start()
time.sleep(0.5)
child = os.fork()
if child:
    sys.exit(os.waitpid(child, 0)[1])
"""}


@pytest.mark.parametrize("case", ENDS)
def test_the_interpreter_ends_while_threads_are_in_calls(database, tmp_path, case):
    path = tmp_path / "scene.db"
    path.write_bytes(database.read_bytes())
    run = subprocess.run([sys.executable, "-c", ENDS[case], path], capture_output=True, text=True, timeout=120)
    assert run.returncode == 0 and "terminate" not in run.stderr, run.stderr


def test_the_number_of_threads_is_that_of_the_programs(database):
    model = cairn.Reconstruction()
    for call in (lambda n: cairn.build_view_graph(database, num_threads=n),
                 lambda n: cairn.adjust_bundle(model, num_threads=n), model.compute_mean_reprojection_error):
        for number in (-1, 1025):
            with pytest.raises(cairn.ConfigError, match=rf"num_threads: {number} is out of range \[0, 1024\]"):
                call(number)


def test_what_a_callback_raises_goes_on(database, tmp_path):
    path = tmp_path / "scene.db"
    path.write_bytes(database.read_bytes())

    def fail(stage, num_done, num_total):
        raise LookupError(f"no more of {stage}")

    with pytest.raises(LookupError, match="no more of"):
        cairn.build_view_graph(path, progress=fail)


def test_messages_go_to_logging(tmp_path, caplog):
    path = tmp_path / "scene.db"
    scene.Scene(num_images=3).write(path)
    with caplog.at_level(logging.INFO, logger="cairn"):
        cairn.build_view_graph(path, options={"pairs_path": str(_pairs(tmp_path))})
    assert any("nobody.jpg" in record.getMessage() and record.levelname == "WARNING" for record in caplog.records)


def _pairs(folder):
    file = folder / "pairs.txt"
    file.write_text("photo01.jpg photo02.jpg\nphoto01.jpg nobody.jpg\n")
    return file


def test_progress_counts_to_the_total(tmp_path):
    path, told = tmp_path / "scene.db", []
    scene.Scene(num_images=5).write(path)
    cairn.build_view_graph(path, progress=lambda *stage: told.append((*stage, threading.get_ident())))
    verifying = [(num_done, num_total) for name, num_done, num_total, _ in told if name == "verifying pairs"]
    assert verifying[0] == (0, 10) and verifying[-1] == (10, 10) and verifying == sorted(verifying)
    assert {thread for *_, thread in told} == {threading.get_ident()}


def test_it_lives_beside_opencv_and_numpy():
    """In a fresh process, whichever is imported first."""
    pytest.importorskip("cv2")
    use = ("import numpy as np; np.linalg.svd(np.eye(50)); cv2.GaussianBlur(np.ones((50, 50)), (3, 3), 1); "
           "print(cairn.Camera.create(1, 'PINHOLE', 500, 640, 480).focal_length)")
    for imports in ("import cv2, cairn; ", "import cairn, cv2; "):
        run = subprocess.run([sys.executable, "-c", imports + use], capture_output=True, text=True, env=os.environ)
        assert run.stdout == "500.0\n", run.stderr
