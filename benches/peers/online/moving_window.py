"""The smallest entrant, to start your own from: a threshold on the drop of a moving mean.

The mean of the last `window` seconds is compared with the mean of the window before it. When the drop between them, above the
threshold, is past its largest value, a puncture is reported while the needle advances, and both windows fill again.
"""

import argparse
import sys
from collections import deque

parser = argparse.ArgumentParser()
parser.add_argument("--window", type=float, default=0.02, help="length of each window in s")
parser.add_argument("--threshold", type=float, default=0.3, help="smallest drop in N")
options = parser.parse_args()

for line in sys.stdin:
    if line.startswith("start"):  # a new stream: forget the previous one; no reply
        n = max(2, round(options.window * float(line.split()[1])))  # samples in a window
        older, newer, sum_older, sum_newer, largest = deque(), deque(), 0.0, 0.0, 0.0
        continue

    time, position, force = map(float, line.split(","))
    newer.append((position, force))
    sum_newer += force
    if len(newer) > n:  # the oldest sample of the newer window moves to the older one
        older.append(newer.popleft())
        sum_newer -= older[-1][1]
        sum_older += older[-1][1]
    if len(older) > n:
        sum_older -= older.popleft()[1]
    drop = (sum_older - sum_newer) / n if len(older) == n else 0.0
    largest = max(largest, drop)

    reply = ""
    if largest > options.threshold and drop < 0.9 * largest:  # past the peak
        if position > newer[0][0]:  # the needle advances
            reply = f"1,{largest:.4f},{largest:.4f}"  # EVENT, DROP_N, CONFIDENCE
        older, newer, sum_older, sum_newer, largest = deque(), deque(), 0.0, 0.0, 0.0
    sys.stdout.write(reply + "\n")  # one line per sample ...
    sys.stdout.flush()  # ... at once
