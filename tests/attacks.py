#!/usr/bin/env python3
"""Attacks on streams, the page server, output folders and memory limits: what a careless controller, a foreign web page, a full disk or
a damaged file does. Every attack has an expected outcome; no process may hang, crash or take more than its limit.

    cargo build --all-features && python3 tests/attacks.py target/debug/stylet [PART OF A NAME]

Loopback addresses only, in a temporary folder. Exit code 1 when an outcome is not the expected one.
"""

import json
import os
import resource
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import zipfile
import zlib

STYLET = os.path.abspath(sys.argv[1])
REPOSITORY = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
LIMIT_S = 60
ATTACKS = []


def attack(function):
    ATTACKS.append(function)
    return function


def run(*args, data=b"", stdin=None, stdout=subprocess.PIPE, shell=None, max_bytes=None):
    """Runs the command; exit code, output, errors, largest memory in bytes."""
    before = lambda: max_bytes and resource.setrlimit(resource.RLIMIT_AS, (max_bytes, max_bytes))
    command = ["bash", "-c", shell] if shell else [STYLET, *args]
    child = subprocess.Popen(command, stdin=stdin or subprocess.PIPE, stdout=stdout, stderr=subprocess.PIPE,
                             preexec_fn=before, env={**os.environ, "S": STYLET})
    peak = [0]

    def watch():
        while child.poll() is None:
            for pid in [child.pid, *children(child.pid)]:
                try:
                    with open(f"/proc/{pid}/statm") as file:
                        peak[0] = max(peak[0], int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE"))
                except OSError:
                    pass
            time.sleep(0.01)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        out, err = child.communicate(None if stdin else data, timeout=LIMIT_S)
    except subprocess.TimeoutExpired:
        child.kill()
        child.communicate()
        raise AssertionError("hangs")
    assert child.returncode >= 0, f"ended by signal {-child.returncode}: {err[-300:]}"
    assert child.returncode not in (3, 101, 134, 137, 139), f"exit code {child.returncode}: {err[-300:]}"
    assert b"panicked" not in err, err[-300:]
    return child.returncode, (out or b""), err.decode(errors="replace"), peak[0]


def children(pid):
    try:
        with open(f"/proc/{pid}/task/{pid}/children") as file:
            return [int(word) for word in file.read().split()]
    except OSError:
        return []


def listen(data, *args, **more):
    """Lines, summary and memory of `listen --stdin`."""
    code, out, err, peak = run("listen", "--stdin", *args, data=data, **more)
    assert code == 0, (code, err)
    assert not any(ord(c) < 32 and c != "\n" for c in err) and len(err) < 20_000, "raw control characters or long text on the terminal"
    return [json.loads(line) for line in out.splitlines()], json.loads(err.strip().splitlines()[-1]), peak


def check_flags(lines, summary):
    for line in lines:
        assert line["used"] != ("reason" in line), line
        assert (line["enhanced_n"] is None) == (not line["used"]), line
    assert summary["unused"] == sum(not line["used"] for line in lines), summary


def samples(times):
    return "".join(f"{t!r},{-0.004 + 1e-6 * k!r},0.01\n" for k, t in enumerate(times)).encode()


def khz(start, count):
    return [start + k * 1e-3 for k in range(count)]


def stream(times, used, restarts):
    lines, summary, _ = listen(samples(times))
    check_flags(lines, summary)
    found = (len(lines) - summary["unused"], summary["restarts"])
    assert found == (used, restarts), f"used and restarts {found}, expected {(used, restarts)}"


# Clocks

@attack
def a_stamp_far_ahead_first():
    stream([1e9, *khz(0, 100)], 97, 1)


@attack
def a_stamp_far_ahead_in_between():
    stream([*khz(0, 50), 1e9, *khz(0.05, 50)], 100, 0)


@attack
def every_second_stamp_far_ahead():
    stream([t for k in range(100) for t in (k * 1e-3, 1e6 + 17.3 * ((k * 37) % 101))], 100, 0)


@attack
def a_clock_that_runs_backward():
    stream([-t for t in khz(0, 500)], 1, 0)
    stream([-10.0 * k for k in range(500)], 1, 0)


@attack
def a_clock_that_stands_still():
    stream([1.0] * 500, 1, 0)


@attack
def two_clocks_interleaved():
    stream([t for k in range(200) for t in (k * 1e-3, 5000 + k * 1e-3)], 200, 0)


@attack
def stamps_in_milliseconds_and_nanoseconds():
    stream([5.0 * k for k in range(100)], 96, 0)
    stream([1.7e18 + 5e6 * k for k in range(100)], 96, 1)


@attack
def ten_restarts_of_the_controller():
    stream(khz(0, 2000) * 10, 20_000 - 9 * 4, 9)


@attack
def a_pause_of_a_minute():
    stream([*khz(0, 100), *khz(60, 100)], 196, 0)


@attack
def stamps_at_the_ends_of_the_number_range():
    lines, summary, _ = listen(samples([0.0, -0.0, 1.7e308, -1.7e308, 5e-324, 1e-300, *khz(0.001, 10)]))
    check_flags(lines, summary)


@attack
def values_that_are_not_finite_or_absurd():
    data = b"0,0,0\nnan,0,0\ninf,0,0\n0.001,1e999,0\n0.002,0,-inf\n0.003,1e300,0\n0.004,0,1e7\n0.005,0,0,1e9\n0.006,0,0\n"
    lines, summary, _ = listen(data)
    check_flags(lines, summary)
    assert [line["used"] for line in lines] == [True] + [False] * 7 + [True], lines


# Lines

@attack
def nothing_at_all():
    assert listen(b"")[1]["samples"] == 0


@attack
def blank_lines_and_comments_only():
    summary = listen(b"\n# note\r\n  \n" * 50_000)[1]
    assert (summary["samples"], summary["bad_lines"]) == (0, 0), summary


@attack
def a_hundred_megabytes_without_a_line_end():
    _, summary, peak = listen(b"x" * 100_000_000 + b"\n0,0,0\n")
    assert (summary["samples"], summary["bad_lines"]) == (1, 1) and peak < 1e8, (summary, peak)


@attack
def bytes_that_are_no_text():
    data = b"\x00\n0,0,0\n\xc0\x80,0,0\n\xed\xa0\x80\n\xff\xfe0\x00,\x00\n0.001,0,0\n" + bytes(range(128, 256)) + b"\n"
    _, summary, _ = listen(data)
    assert (summary["samples"], summary["bad_lines"]) == (2, 5), summary


@attack
def escape_sequences():
    listen(b"\x1b[2J\x1b]0;title\x07\n" * 100 + "1,\u202e\u200b,2\n".encode() * 100 + b"{\"\x1b[31m\n")


@attack
def json_that_is_nested_doubled_or_incomplete():
    good = b'{"time_s":0.001,"position_m":0,"force_n":0,"x":{"y":[1,{"z":null}]}}\n'
    deep = b'{"time_s":0.002,"x":' + b"[" * 30_000 + b"\n"
    double = b'{"time_s":0,"time_s":1,"position_m":0,"force_n":0}\n'
    text = b'{"time_s":"0","position_m":0,"force_n":0}\n'
    _, summary, _ = listen(good + deep + double + text + b"{}\n[]\nnull\n{\n")
    assert (summary["samples"], summary["bad_lines"]) == (1, 7), summary


@attack
def numbers_in_other_notations():
    _, summary, _ = listen(b"0x10,0,0\n1_000,0,0\n1;2;3\n0,5;0,0;0,1\n,,\n1,2,3,4,5\n1,2\n1,,3\n")
    assert (summary["samples"], summary["bad_lines"]) == (0, 8), summary


@attack
def line_ends_of_other_systems_and_a_byte_order_mark():
    _, summary, _ = listen("\ufefftime_s,position_m,force_n\r\n0,0,0\r\n0.001,0,0\r\n".encode())
    assert (summary["samples"], summary["bad_lines"]) == (2, 0), summary


@attack
def a_header_in_the_middle():
    data = b"time_s,position_m,force_n\n" + samples(khz(0, 100))
    _, summary, _ = listen(data * 3)
    assert (summary["bad_lines"], summary["restarts"]) == (0, 0) and summary["samples"] == 300, summary


# Ends

@attack
def standard_input_that_is_closed_or_a_folder():
    code, _, err, _ = run(shell="$S listen --stdin < /tmp")
    assert code == 2 and "standard input" in err and '"samples":0' in err, (code, err)
    code, _, err, _ = run(shell="$S listen --stdin <&-")
    assert code in (0, 2), (code, err)


@attack
def a_full_disk():
    code, _, err, _ = run(shell="(echo 0,0,0; sleep 20) | $S listen --stdin > /dev/full & wait $(jobs -p | tail -1)")
    assert code == 2 and "cannot be written" in err and '"samples":1' in err, (code, err)


@attack
def a_reader_that_leaves():
    code, _, err, _ = run(shell="set -o pipefail; yes '0,0,0' | head -200000 | $S listen --stdin | head -1 > /dev/null; echo ${PIPESTATUS[2]} >&2")
    assert err.strip().splitlines()[-1] == "0", err


@attack
def a_reader_that_stalls_and_a_signal():
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        child = subprocess.Popen([STYLET, "listen", "--stdin"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        child.stdin.write(samples(khz(0, 20_000)))
        child.stdin.flush()
        time.sleep(3)
        start = time.monotonic()
        child.send_signal(number)
        child.wait(8)
        assert time.monotonic() - start < 5 and child.returncode == 0, (number, child.returncode)
        assert b'"samples":20000' in child.stderr.read()


@attack
def two_signals():
    child = subprocess.Popen([STYLET, "listen", "--stdin"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    child.stdin.write(samples(khz(0, 20_000)))
    child.stdin.flush()
    time.sleep(0.5)
    child.send_signal(signal.SIGINT)
    time.sleep(0.3)
    child.send_signal(signal.SIGINT)
    assert child.wait(3) == 130


@attack
def a_duration_while_the_input_stays_open():
    child = subprocess.Popen([STYLET, "listen", "--stdin", "--duration-s", "0.5"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert child.wait(5) == 0


# Datagrams

def udp(*args):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    child = subprocess.Popen([STYLET, "listen", "--udp", str(port), *args], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    out.connect(("127.0.0.1", port))
    time.sleep(0.5)
    return child, out, port


def end(child, out):
    out.send(b"end")
    err = child.stderr.read()
    assert child.wait(10) == 0, err
    return json.loads(err.strip().splitlines()[-1])


@attack
def datagrams_of_any_size():
    child, out, _ = udp()
    for data in (b"", b"\n", b"0,0,0", b"0.001,0,0\n0.002,0,0\n", b"x" * 65507, b"\x00" * 1000, b"end of file", b" end\n"[:0], b"0.003,0,0\r\n\r\n"):
        out.send(data)
    summary = end(child, out)
    assert (summary["samples"], summary["bad_lines"], summary["dropped_by_system"]) == (4, 3, 0), summary


@attack
def forwarding_to_nobody_to_itself_and_to_nonsense():
    child, out, port = udp("--forward", "127.0.0.1:9", "--quiet")
    for k in range(20):
        out.send(f"{k * 1e-3},0,0".encode())
        time.sleep(0.01)
    assert end(child, out)["not_forwarded"] > 0
    for target in (f"127.0.0.1:{port}", f"localhost:{port}", "nowhere", "127.0.0.1:99999", ""):
        code, _, err, _ = run("listen", "--udp", str(port), "--forward", target, "--duration-s", "0.2")
        assert code == 2 and "--forward" in err, (target, code, err)


@attack
def ports_and_hosts_that_cannot_be_bound():
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        port = str(busy.getsockname()[1])
        assert run("listen", "--stdin", "--page", port)[0] == 2
    assert run("listen", "--udp", "5005", "--host", "no.such.host.invalid")[0] == 2
    assert run("listen", "--udp", "70000")[0] == 2


# Page

def page(*args):
    child = subprocess.Popen([STYLET, "listen", "--stdin", "--quiet", "--page", "0", *args], stdin=subprocess.PIPE, stderr=subprocess.PIPE)
    host, port = child.stderr.readline().decode().split("http://")[1].strip().rstrip("/").rsplit(":", 1)
    return child, (host, int(port))


def ask(address, data, wait_s=8):
    with socket.create_connection(address, 5) as s:
        s.settimeout(wait_s)
        try:
            s.sendall(data)
        except OSError:
            pass
        try:
            return s.recv(200).split(b"\r\n")[0].decode()
        except OSError:
            return ""


def alive(child, address):
    found = ask(address, b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
    assert found == "HTTP/1.1 200 OK", found
    child.stdin.close()
    assert child.wait(10) == 0


@attack
def a_request_of_three_hundred_megabytes():
    child, address = page()
    with socket.create_connection(address, 5) as s:
        sent = 0
        try:
            for _ in range(300):
                s.sendall(b"a" * 1_000_000)
                sent += 1
        except OSError:
            pass
    with open(f"/proc/{child.pid}/statm") as file:
        memory = int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    assert memory < 6e7 and sent < 300, (memory, sent)
    alive(child, address)


@attack
def connections_that_say_nothing():
    child, address = page()
    silent = [socket.create_connection(address, 5) for _ in range(40)]
    assert ask(address, b"GET / HTTP/1.1\r\n\r\n") in ("HTTP/1.1 503 Service Unavailable", "")
    time.sleep(6)
    # Their places are free again.
    alive(child, address)
    for s in silent:
        s.close()


@attack
def five_hundred_connections_that_close_at_once():
    child, address = page()
    for _ in range(500):
        socket.create_connection(address, 5).close()
    time.sleep(0.5)
    alive(child, address)


@attack
def requests_that_are_not_http():
    child, address = page()
    for data, status in [
        (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n", "400"), (b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", "400"),
        (b"GET http://evil.example/ HTTP/1.1\r\n\r\n", "421"), (b"GET / HTTP/1.1\r\nHost\r\n\r\n", "400"),
        (b"\r\n\r\n", "400"), (b"GET /\xff HTTP/1.1\r\n\r\n", "400"), (b"OPTIONS / HTTP/1.1\r\n\r\n", "405"),
        (b"CONNECT / HTTP/1.1\r\n\r\n", "405"), (b"GET /../../etc/passwd HTTP/1.1\r\n\r\n", "404"),
        (b"GET /events/../x HTTP/1.1\r\n\r\n", "404"), (b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 3000 + b"\r\n", "431"),
    ]:
        found = ask(address, data)
        assert found.split(" ")[1:2] in ([status], []), (data[:40], found)
    alive(child, address)


@attack
def a_foreign_web_page():
    child, address = page()
    for headers, status in [
        (b"Host: evil.example", "421"), (b"Host: 127.0.0.1.evil.example", "421"), (b"Host: localhost\r\nHost: evil.example", "421"),
        (b"Host: ", "421"), (b"Host: localhost\r\nOrigin: https://evil.example", "403"), (b"Host: localhost\r\nOrigin: null", "403"),
        (b"Host: 127.0.0.1:1\r\nOrigin: http://127.0.0.1:1", "200"), (b"HOST:localhost", "200"),
    ]:
        found = ask(address, b"GET /events HTTP/1.1\r\n" + headers + b"\r\n\r\n")
        assert found.split(" ")[1] == status, (headers, found)
    alive(child, address)


@attack
def stalled_readers_while_the_stream_runs():
    child, address = page()
    held = []
    for _ in range(100):
        s = socket.create_connection(address, 5)
        s.sendall(b"GET /events HTTP/1.1\r\n\r\n")
        held.append(s)
    child.stdin.write(samples(khz(0, 30_000)))
    child.stdin.close()
    err = child.stderr.read().decode()
    assert child.wait(20) == 0
    summary = json.loads(err.strip().splitlines()[-1])
    assert (summary["samples"], summary["unused"], summary["refused_readers"]) == (30_000, 0, 68), summary


# Folders and memory

SCENARIO = """Scenario(name: "gel", motion: Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 8.0), robot: Replay,
    tissue: (layers: [(thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.4)]))"""


def write(name, text):
    os.makedirs(os.path.dirname(name) or ".", exist_ok=True)
    with open(name, "w" if isinstance(text, str) else "wb") as file:
        file.write(text)


def refused(name, *args, shown=None):
    with open(name, "rb") as file:
        before = file.read()
    code, _, err, _ = run(*args)
    flat = err.replace("\n", "").replace(" ", "").replace("│", "")
    assert code == 2 and os.path.basename(shown or name) in flat, (code, err)
    with open(name, "rb") as file:
        assert file.read() == before, f"{name} was changed"


def succeeds(*args):
    code, _, err, _ = run(*args)
    assert code == 0, err


@attack
def an_output_folder_with_foreign_files():
    for name in ("recording.csv", "score.json", "scenario.ron", "figure.svg", "report.html", "manifest.json"):
        write(f"f-{name}/{name}", "mine")
        refused(f"f-{name}/{name}", "run", "gel.ron", "--out", f"f-{name}")


@attack
def an_output_folder_by_a_link():
    write("target/recording.csv", "mine")
    os.symlink("target", "link")
    refused("target/recording.csv", "run", "gel.ron", "--out", "link")


@attack
def an_output_that_links_to_an_input():
    os.makedirs("l", exist_ok=True)
    shutil.copy("gel.ron", "precious.ron")
    os.symlink("../precious.ron", "l/scenario.ron")
    refused("precious.ron", "run", "precious.ron", "--out", "l", shown="scenario.ron")


@attack
def an_output_that_is_a_broken_link():
    os.makedirs("b", exist_ok=True)
    os.symlink("/nowhere/at/all", "b/recording.csv")
    code, _, err, _ = run("run", "gel.ron", "--out", "b")
    assert code == 2 and os.path.islink("b/recording.csv"), (code, err)


@attack
def a_folder_in_the_place_of_an_output():
    os.makedirs("d/recording.csv")
    assert run("run", "gel.ron", "--out", "d")[0] == 2
    assert os.listdir("d") == ["recording.csv"]
    os.makedirs("e/manifest.json")
    assert run("run", "gel.ron", "--out", "e")[0] == 2


@attack
def an_output_folder_that_is_a_file():
    write("file", "mine")
    assert run("run", "gel.ron", "--out", "file")[0] == 2
    assert open("file").read() == "mine"


@attack
def a_manifest_that_lists_foreign_files():
    # A set of an enhancement cannot be claimed by a run.
    succeeds("run", "gel.ron", "--out", "r1")
    succeeds("enhance", "r1/recording.csv", "--out", "e1")
    code, _, err, _ = run("run", "gel.ron", "--out", "e1")
    assert code == 2 and "enhance.json" in err.replace("\n", ""), err


@attack
def a_recording_converted_onto_itself_and_others():
    succeeds("run", "gel.ron", "--out", "r2")
    shutil.copy("r2/recording.csv", "log.csv")
    refused("log.csv", "convert", "log.csv", "./log.csv")
    os.symlink("log.csv", "alias.csv")
    refused("log.csv", "convert", "log.csv", "alias.csv", shown="alias.csv")
    write("p.csv", "mine")
    refused("p.csv", "convert", "log.csv", "p.csv")


@attack
def an_endless_pipe():
    code, _, err, peak = run(shell="(echo time_s,position_m,force_n; yes 1,2,3) | $S enhance /dev/stdin --limit-memory 300MB --out pipe")
    assert code == 2 and "limit" in err and peak < 6e8, (code, err[-300:], peak)


@attack
def a_pipe_without_a_line_end():
    code, _, err, peak = run(shell="$S enhance /dev/zero --limit-memory 300MB --out zero")
    assert code == 2 and peak < 6e8, (code, err[-300:], peak)


def too_large(name, limit="300MB", most=6e8):
    code, _, err, peak = run("enhance", name, "--limit-memory", limit, "--out", "large")
    assert code == 2 and "limit" in err and peak < most, (code, err[-300:], peak)


@attack
def a_small_matlab_file_that_decompresses_to_a_gigabyte():
    def element(kind, data):
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    def variable(name, rows):
        head = element(6, struct.pack("<II", 9, 0)) + element(5, struct.pack("<ii", rows, 1)) + element(1, name)
        data = element(2, bytes(rows))
        return struct.pack("<II", 14, len(head) + len(data)) + head + data

    out = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    for name in (b"time_s", b"position_m", b"force_n"):
        packed = zlib.compress(variable(name, 300_000_000), 9)
        out += struct.pack("<II", 15, len(packed)) + packed
    write("bomb.mat", out)
    too_large("bomb.mat")


@attack
def a_spreadsheet_with_two_distant_cells():
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    package = "http://schemas.openxmlformats.org/package/2006/relationships"
    with zipfile.ZipFile("bomb.xlsx", "w", zipfile.ZIP_DEFLATED) as book:
        book.writestr("_rels/.rels", f'<Relationships xmlns="{package}"><Relationship Id="rId1" Type="{office}/officeDocument" Target="xl/workbook.xml"/></Relationships>')
        book.writestr("xl/_rels/workbook.xml.rels", f'<Relationships xmlns="{package}"><Relationship Id="rId1" Type="{office}/worksheet" Target="worksheets/sheet1.xml"/></Relationships>')
        book.writestr("xl/workbook.xml", f'<workbook xmlns="{main}" xmlns:r="{office}"><sheets><sheet name="S" sheetId="1" r:id="rId1"/></sheets></workbook>')
        book.writestr("xl/worksheets/sheet1.xml", f'<worksheet xmlns="{main}"><sheetData><row r="1"><c r="A1"><v>1</v></c></row><row r="1048576"><c r="XFD1048576"><v>2</v></c></row></sheetData></worksheet>')
    too_large("bomb.xlsx")


@attack
def an_hdf5_file_that_declares_three_hundred_million_rows():
    fixture = os.path.join(REPOSITORY, "crates/record/tests/foreign/matlab.mat")
    with open(fixture, "rb") as file:
        data = file.read()
    write("bomb_hdf5.mat", data.replace(struct.pack("<Q", 60), struct.pack("<Q", 300_000_000)))
    write("map.ron", 'Columns(time: (name: "time", scale: 1e-3), position: (name: "pz", scale: 1e-3), force: (name: "log.wrench.3", scale: -1.0))')
    code, _, err, peak = run("enhance", "bomb_hdf5.mat", "--columns", "map.ron", "--limit-memory", "300MB", "--out", "large")
    assert code == 2 and peak < 6e8, (code, err[-300:], peak)


@attack
def an_mcap_log_without_its_end():
    succeeds("run", "gel.ron", "--out", "r3")
    succeeds("convert", "r3/recording.csv", "whole.mcap")
    write("map.ron", 'Columns(time: (name: "/insertion.time_s"), position: (name: "/insertion.position_m"), force: (name: "/insertion.force_n"))')
    with open("whole.mcap", "rb") as file:
        data = file.read()
    for cut in (8, 20, 100, 1000):
        write("cut.mcap", data[:-cut])
        succeeds("enhance", "cut.mcap", "--columns", "map.ron", "--out", f"cut{cut}")


@attack
def scenarios_with_absurd_values_and_names():
    for old, new in (("50.0", "1e308"), ("9000.0", "1e300"), ("0.4", "1e300"), ("8.0", "1e300"), ("0.0023", "-1e300")):
        write("absurd.ron", SCENARIO.replace(old, new))
        code, _, err, _ = run("run", "absurd.ron", "--out", "absurd")
        assert code == 2 and "0" * 30 not in err.replace("\n", "").replace(" ", ""), (new, code, err)
    shutil.copy("gel.ron", "two\nlines.ron")
    succeeds("run", "two\nlines.ron", "--out", "lines")
    succeeds("run", "lines/scenario.ron", "--out", "again")


if __name__ == "__main__":
    wanted = sys.argv[2] if len(sys.argv) > 2 else ""
    failed = 0
    for function in [f for f in ATTACKS if wanted in f.__name__]:
        folder = tempfile.mkdtemp(prefix="stylet-attack-")
        os.chdir(folder)
        write("gel.ron", SCENARIO)
        start = time.monotonic()
        try:
            function()
            result = "ok"
        except Exception as why:  # every kind of failure is a finding
            result, failed = f"FAIL {why!r}"[:700], failed + 1
        os.chdir("/")
        shutil.rmtree(folder, ignore_errors=True)
        print(f"{function.__name__.replace('_', ' '):60} {time.monotonic() - start:6.1f} s  {result}", flush=True)
    print(f"{failed} of {len(ATTACKS)} attacks succeeded")
    sys.exit(bool(failed))
