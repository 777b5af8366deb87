// The online core behind two streams, tip and force, without ROS.
#pragma once
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <optional>
#include <stdexcept>
#include <stylet.h>

class PairedEnhancer {
  public:
    // `by_stamp`: a sample is a tip and a force with the same stamp. Otherwise each force takes the latest tip.
    PairedEnhancer(std::size_t samples, bool by_stamp) : by_stamp_(by_stamp) {
        const std::size_t align = stylet_align(), bytes = (stylet_size(samples) + align - 1) / align * align;
        memory_.reset(std::aligned_alloc(align, bytes));
        const char *why = "no memory";
        if (!memory_ || stylet_init(memory_.get(), bytes, nullptr, &core_, &why) != STYLET_OK) throw std::runtime_error(why);
    }

    // Depth in m and velocity in m/s at a stamp in ns. Returns the output of the sample that this completes, if it was used.
    std::optional<StyletOutput> tip(std::int64_t stamp_ns, double position_m, double velocity_mps) {
        tip_ = Tip{stamp_ns, position_m, velocity_mps};
        return by_stamp_ && force_ && force_->stamp_ns == stamp_ns ? step() : std::nullopt;
    }

    // Axial force in N, positive when the tissue resists, at a stamp in ns.
    std::optional<StyletOutput> force(std::int64_t stamp_ns, double force_n) {
        force_ = Force{stamp_ns, force_n};
        return tip_ && (!by_stamp_ || tip_->stamp_ns == stamp_ns) ? step() : std::nullopt;
    }

  private:
    struct Tip { std::int64_t stamp_ns; double position_m, velocity_mps; };
    struct Force { std::int64_t stamp_ns; double force_n; };
    struct Free { void operator()(void *p) const { std::free(p); } };

    std::optional<StyletOutput> step() {
        // Seconds since the first sample: those since 1970 have 0.2 microseconds of resolution.
        if (!first_ns_) first_ns_ = force_->stamp_ns;
        const double time_s = static_cast<double>(force_->stamp_ns - *first_ns_) / 1e9;
        StyletOutput out;
        const StyletStatus status = stylet_step(core_, time_s, tip_->position_m, tip_->velocity_mps, force_->force_n, &out);
        return status == STYLET_OK ? std::optional<StyletOutput>(out) : std::nullopt;
    }

    std::unique_ptr<void, Free> memory_;
    StyletCore *core_ = nullptr;
    bool by_stamp_;
    std::optional<std::int64_t> first_ns_;
    std::optional<Tip> tip_;
    std::optional<Force> force_;
};
