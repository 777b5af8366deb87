#!/usr/bin/env python3
"""Ten minutes of `stylet listen` at 1 kHz under attack: the core loses no sample, everything passed over is counted and flagged,
memory stays flat.

    cargo build --release && python3 tests/listen_long.py target/release/stylet [SECONDS]

Samples at 1 kHz by UDP, in real time. The controller restarts every minute, one stamp in 7000 is wrong by 1e9 s, a corrupt line
comes every half second, 1000 connections ask for the event stream and never read, and every two minutes another sender floods the
port with 100 000 lines per second for 5 s. Afterwards single datagrams at full speed, until the kernel drops some: these must be
counted. Loopback only. Exit code 1 when a promise does not hold.
"""

import json
import math
import multiprocessing
import os
import resource
import socket
import subprocess
import sys
import threading
import time

RESTART_S, FLOOD_S, FLOOD_EVERY_S = 60, 5, 120
FLOOD_LINES_PER_S, LINES_PER_DATAGRAM = 100_000, 50
READERS = 1000
WARM_UP_S = 60
MEMORY_GROWTH_BYTES = 16 << 20


def sample(k):
    """Air, then three layers, as in tests/listen.rs."""
    t = k * 1e-3
    z = -0.004 + 0.0023 * (t % 60)
    inside = max(z, 0) % 0.03
    force = (60 * inside + 20 * z if z > 0 else 0) + 0.01 * math.sin(12.9898 * k)
    return f"{t!r},{z!r},{force!r},0.0023"


def flood(port, seconds, sent):
    """Garbage and a stale sample, which continues no clock; `sent` receives datagrams."""
    bad = "\x1b[2J,not a number," + "x" * 30
    text = ("\n".join([bad] * (LINES_PER_DATAGRAM - 1)) + "\n-5,0,0").encode()
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    out.connect(("127.0.0.1", port))
    start, count = time.monotonic(), 0
    while (now := time.monotonic() - start) < seconds:
        while count < now * FLOOD_LINES_PER_S / LINES_PER_DATAGRAM:
            out.send(text)
            count += 1
        time.sleep(0.0005)
    sent.value += count


def hold_readers(address, stop):
    """Connections that ask and never read; those that were closed are opened again."""
    readers = []
    while not stop.is_set():
        alive = []
        for reader in readers:
            try:
                # A refused connection holds a response and its end.
                reader.setblocking(False)
                data = reader.recv(64, socket.MSG_PEEK)
                if data.startswith(b"HTTP/1.1 200"):
                    alive.append(reader)
                    continue
            except BlockingIOError:
                alive.append(reader)
                continue
            except OSError:
                pass
            reader.close()
        readers = alive
        while len(readers) < READERS and not stop.is_set():
            try:
                reader = socket.create_connection(address, 1)
                reader.sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
                readers.append(reader)
            except OSError:
                break
        stop.wait(5)


def memory_bytes(pid):
    with open(f"/proc/{pid}/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def listen(stylet, *args):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [stylet, "listen", "--udp", str(port), "--quiet", *args]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True), port


def finish(child, out):
    time.sleep(1)
    out.send(b"end")
    return json.loads(child.stderr.read().strip().splitlines()[-1])


def steady(stylet, seconds):
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
    receiver.bind(("127.0.0.1", 0))
    child, port = listen(stylet, "--page", "0", "--forward", "127.0.0.1:%d" % receiver.getsockname()[1])
    page = child.stderr.readline().split("http://")[1].strip().rstrip("/")
    stop = threading.Event()
    host, page_port = page.rsplit(":", 1)
    readers = threading.Thread(target=hold_readers, args=((host, int(page_port)), stop), daemon=True)
    readers.start()
    flags = {"lines": 0, "used": 0, "reasons": 0, "nulls": 0}

    def count_forwarded():
        receiver.settimeout(1)
        while not stop.is_set():
            try:
                line = json.loads(receiver.recv(65536))
            except TimeoutError:
                continue
            flags["lines"] += 1
            flags["used"] += line["used"]
            flags["reasons"] += "reason" in line
            flags["nulls"] += line["enhanced_n"] is None

    counter = threading.Thread(target=count_forwarded, daemon=True)
    counter.start()
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    out.connect(("127.0.0.1", port))
    flooded = multiprocessing.Value("q", 0)
    sent = {"samples": 0, "outliers": 0, "restarts": 0, "bad": 0}
    memory, floods = [], []
    start, restarted = time.monotonic(), 0
    for k in range(seconds * 1000):
        time.sleep(max(0, start + k * 1e-3 - time.monotonic()))
        if k and k % (RESTART_S * 1000) == 0:
            restarted = k
            sent["restarts"] += 1
        if k % 7000 == 3500:
            out.send(b"1e9,0,0,0")
            sent["outliers"] += 1
        if k % 500 == 250:
            out.send([b"\xff\xfe,1", b"1;2;3", b"{\"time_s\":", b"1,2"][k // 500 % 4])
            sent["bad"] += 1
        out.send(sample(k - restarted).encode())
        sent["samples"] += 1
        if k % (FLOOD_EVERY_S * 1000) == 30_000 or (seconds < 60 and k == 5000):
            floods.append(multiprocessing.Process(target=flood, args=(port, FLOOD_S, flooded)))
            floods[-1].start()
        if k % 1000 == 0 and k >= min(WARM_UP_S, seconds // 2) * 1000:
            memory.append(memory_bytes(child.pid))
    for process in floods:
        process.join()
    time.sleep(1)
    stop.set()
    counter.join()
    counts = finish(child, out)
    stale = flooded.value
    expected = {
        "samples": sent["samples"] + sent["outliers"] + stale,
        # Four samples wait at each new clock.
        "unused": sent["outliers"] + stale + 4 * sent["restarts"],
        "restarts": sent["restarts"],
        "bad_lines": sent["bad"] + stale * (LINES_PER_DATAGRAM - 1),
        "dropped_by_system": 0,
    }
    print("counts", json.dumps(counts))
    print("sent", json.dumps(sent), "flood datagrams", stale, "forwarded", json.dumps(flags))
    failures = [f"{name}: {counts[name]}, expected {value}" for name, value in expected.items() if counts[name] != value]
    if flags["lines"] - flags["used"] != flags["reasons"] or flags["reasons"] != flags["nulls"]:
        failures.append(f"a line that was not used has no reason or a value: {flags}")
    growth = max(memory, default=0) - (memory[0] if memory else 0)
    print(f"memory {memory[0] / 1e6 if memory else 0:.1f} MB after the warm-up, growth {growth / 1e6:.1f} MB")
    if growth > MEMORY_GROWTH_BYTES:
        failures.append(f"memory grew by {growth / 1e6:.1f} MB")
    if counts["refused_readers"] == 0 or counts["dropped_by_readers"] == 0:
        failures.append("the stalled readers were neither refused nor counted")
    return failures


def overload(stylet):
    """More single datagrams than can be received: every one is received or counted as dropped."""
    child, port = listen(stylet)
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    out.connect(("127.0.0.1", port))
    time.sleep(0.5)
    start, sent = time.monotonic(), 0
    # Stopped for a moment, as on a busy computer.
    child.send_signal(19)
    while time.monotonic() - start < FLOOD_S:
        for _ in range(100):
            out.send(b"-5,0,0")
            sent += 1
        if time.monotonic() - start > 1:
            child.send_signal(18)
    time.sleep(0.5)
    # The counter comes with the next datagram.
    out.send(b"-5,0,0")
    counts = finish(child, out)
    print(f"overload: sent {sent + 1}, counts", json.dumps(counts))
    received = counts["samples"] + counts["dropped_by_system"]
    failures = [] if received == sent + 1 else [f"{sent + 1} datagrams sent, {received} received or counted as dropped"]
    if counts["dropped_by_system"] == 0:
        failures.append("the kernel dropped nothing: no overload")
    return failures


if __name__ == "__main__":
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, 8192), hard))
    seconds = int(sys.argv[2]) if len(sys.argv) > 2 else 600
    wrong = steady(sys.argv[1], seconds) + overload(sys.argv[1])
    for what in wrong:
        print("FAIL", what)
    print("all promises hold" if not wrong else f"{len(wrong)} promises do not hold")
    sys.exit(bool(wrong))
