// The core as a ROS 2 node. Subscribes to geometry_msgs/WrenchStamped on `wrench` (force along the axis: parameter `axis`, x, y or z)
// and geometry_msgs/TwistStamped on `tip` (linear.x: depth in m, linear.y: velocity in m/s), publishes the enhanced force on
// `enhanced` (std_msgs/Float64, N) and ruptures on `ruptures` (std_msgs/UInt32, number so far). Built only with ROS 2;
// the callback allocates nothing apart from ROS.
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string>
#include <geometry_msgs/msg/twist_stamped.hpp>
#include <geometry_msgs/msg/wrench_stamped.hpp>
#include <rclcpp/rclcpp.hpp>
#include <std_msgs/msg/float64.hpp>
#include <std_msgs/msg/u_int32.hpp>
#include <stylet.h>

class Node : public rclcpp::Node {
  public:
    Node() : rclcpp::Node("stylet") {
        axis_ = declare_parameter<std::string>("axis", "z");
        const std::size_t bytes = stylet_size(static_cast<std::size_t>(declare_parameter<int>("samples", 16384)));
        memory_.reset(std::aligned_alloc(64, (bytes + 63) / 64 * 64));
        const char *why = "";
        if (stylet_init(memory_.get(), bytes, nullptr, &core_, &why) != STYLET_OK) throw std::runtime_error(why);
        enhanced_ = create_publisher<std_msgs::msg::Float64>("enhanced", 10);
        ruptures_ = create_publisher<std_msgs::msg::UInt32>("ruptures", 10);
        tip_ = create_subscription<geometry_msgs::msg::TwistStamped>("tip", rclcpp::SensorDataQoS(),
            [this](const geometry_msgs::msg::TwistStamped &tip) { position_m_ = tip.twist.linear.x; velocity_mps_ = tip.twist.linear.y; });
        wrench_ = create_subscription<geometry_msgs::msg::WrenchStamped>("wrench", rclcpp::SensorDataQoS(),
            [this](const geometry_msgs::msg::WrenchStamped &wrench) { hear(wrench); });
    }

  private:
    void hear(const geometry_msgs::msg::WrenchStamped &wrench) {
        const auto &f = wrench.wrench.force;
        const double force_n = axis_ == "x" ? f.x : axis_ == "y" ? f.y : f.z;
        StyletOutput out;
        if (stylet_step(core_, rclcpp::Time(wrench.header.stamp).seconds(), position_m_, velocity_mps_, force_n, &out) != STYLET_OK) return;
        std_msgs::msg::Float64 enhanced;
        enhanced.data = out.enhanced_n;
        enhanced_->publish(enhanced);
        if (out.ruptured) {
            std_msgs::msg::UInt32 ruptures;
            ruptures.data = out.ruptures;
            ruptures_->publish(ruptures);
        }
    }

    struct Free { void operator()(void *p) const { std::free(p); } };
    std::unique_ptr<void, Free> memory_;
    StyletCore *core_ = nullptr;
    std::string axis_;
    double position_m_ = 0.0, velocity_mps_ = 0.0;
    rclcpp::Publisher<std_msgs::msg::Float64>::SharedPtr enhanced_;
    rclcpp::Publisher<std_msgs::msg::UInt32>::SharedPtr ruptures_;
    rclcpp::Subscription<geometry_msgs::msg::TwistStamped>::SharedPtr tip_;
    rclcpp::Subscription<geometry_msgs::msg::WrenchStamped>::SharedPtr wrench_;
};

int main(int argc, char **argv) {
    rclcpp::init(argc, argv);
    rclcpp::spin(std::make_shared<Node>());
    rclcpp::shutdown();
    return 0;
}
