// The node's algorithm without ROS: reads samples "stamp_ns position_m velocity_mps force_n" from standard input and writes the enhanced
// forces as 64-bit floats. Every other sample brings the force before the tip.
#include "../src/paired_enhancer.hpp"
#include <cstdio>

int main() {
    PairedEnhancer enhancer(16384, true);
    long long stamp_ns;
    double position_m, velocity_mps, force_n;
    for (bool force_first = false; std::scanf("%lld %lf %lf %lf", &stamp_ns, &position_m, &velocity_mps, &force_n) == 4; force_first = !force_first) {
        std::optional<StyletOutput> first, second;
        if (force_first) {
            first = enhancer.force(stamp_ns, force_n);
            second = enhancer.tip(stamp_ns, position_m, velocity_mps);
        } else {
            first = enhancer.tip(stamp_ns, position_m, velocity_mps);
            second = enhancer.force(stamp_ns, force_n);
        }
        if (first || !second) return 1;
        std::fwrite(&second->enhanced_n, sizeof second->enhanced_n, 1, stdout);
    }
    return 0;
}
