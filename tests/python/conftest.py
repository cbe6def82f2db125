import os

# NumPy's threads wait for each other by spinning, which takes minutes where several tests run at a time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
