# ROS 2 package: sources for a workspace with the C library.
make() {
    local tree="$clean/stylet_ros"
    cp -r packaging/ros2/stylet_ros "$tree"
    # The recording with the command's enhanced force, for the replay test.
    paste -d, "$recording" <(cut -d, -f"$(head -1 "$temporary/reference/enhanced/enhanced.csv" | tr , '\n' | grep -nx enhanced_n | cut -d: -f1)" \
        "$temporary/reference/enhanced/enhanced.csv") >"$tree/test/replay.csv"
    pack "$tree" "$out/stylet-ros2-$version.tar.gz"
    rm -r "$tree"
}
check() {
    need c++ "a C++ compiler"
    tar -xzf "$out/stylet-ros2-$version.tar.gz" -C "$clean"
    crates/capi/install.sh "$clean/prefix"
    # What needs no ROS: reading of the recording, pairing of the two streams, the algorithm.
    c++ -std=c++17 -Wall -Wextra -Werror -O2 -I"$clean/prefix/include" "$clean/stylet_ros/test/without_ros.cpp" "$clean/prefix/lib/libstylet.a" -lm -lpthread -ldl -o "$clean/without_ros"
    hash_is "$(cd "$clean/stylet_ros/scripts" && python3 -c '
import sys
from replay_recording import read_samples
for sample in read_samples(sys.argv[1]):
    print(*sample)' ../test/replay.csv | "$clean/without_ros" | sha256sum | cut -c1-32)"
    [ "$(cat "$note/hashes")" = "$reference" ]
    command -v colcon >/dev/null 2>&1 && [ -n "${ROS_DISTRO:-}" ] ||
        skip "no ROS 2 (what needs no ROS was compiled and gives $(cat "$note/hashes"))"
    cd "$clean"
    colcon build --packages-select stylet_ros --cmake-args "-DCMAKE_PREFIX_PATH=$clean/prefix"
    STYLET_REPLAY_BYTES="$clean/bytes" colcon test --packages-select stylet_ros --event-handlers console_direct+
    colcon test-result --verbose
    hash_is "$(sha256sum <"$clean/bytes" | cut -c1-32)"
    installed "built by colcon in an empty workspace (ROS 2 $ROS_DISTRO), replay test"
}
