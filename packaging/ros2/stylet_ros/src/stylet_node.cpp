// The core as a ROS 2 node. Subscribes to geometry_msgs/WrenchStamped on `wrench` (force along the axis: parameter `axis`, x, y or z)
// and geometry_msgs/TwistStamped on `tip` (linear.x: depth in m, linear.y: velocity in m/s), publishes the enhanced force on
// `enhanced` (std_msgs/Float64, N) and ruptures on `ruptures` (std_msgs/UInt32, number so far). The callbacks allocate nothing
// apart from ROS.
#include "paired_enhancer.hpp"
#include <geometry_msgs/msg/twist_stamped.hpp>
#include <geometry_msgs/msg/wrench_stamped.hpp>
#include <rclcpp/rclcpp.hpp>
#include <std_msgs/msg/float64.hpp>
#include <std_msgs/msg/u_int32.hpp>
#include <string>

class StyletNode : public rclcpp::Node {
  public:
    StyletNode()
        : rclcpp::Node("stylet"), axis_(declare_parameter<std::string>("axis", "z")),
          enhancer_(static_cast<std::size_t>(declare_parameter<int>("samples", 16384)), declare_parameter<bool>("pair_by_stamp", false)) {
        if (axis_ != "x" && axis_ != "y" && axis_ != "z") throw std::runtime_error("parameter axis: must be x, y or z");
        enhanced_ = create_publisher<std_msgs::msg::Float64>("enhanced", 10);
        ruptures_ = create_publisher<std_msgs::msg::UInt32>("ruptures", 10);
        tip_ = create_subscription<geometry_msgs::msg::TwistStamped>("tip", rclcpp::SensorDataQoS(),
            [this](const geometry_msgs::msg::TwistStamped &m) { publish(enhancer_.tip(nanoseconds(m.header), m.twist.linear.x, m.twist.linear.y)); });
        wrench_ = create_subscription<geometry_msgs::msg::WrenchStamped>("wrench", rclcpp::SensorDataQoS(),
            [this](const geometry_msgs::msg::WrenchStamped &m) {
                const auto &f = m.wrench.force;
                publish(enhancer_.force(nanoseconds(m.header), axis_ == "x" ? f.x : axis_ == "y" ? f.y : f.z));
            });
    }

  private:
    static std::int64_t nanoseconds(const std_msgs::msg::Header &header) { return rclcpp::Time(header.stamp).nanoseconds(); }

    void publish(const std::optional<StyletOutput> &out) {
        if (!out) return;
        std_msgs::msg::Float64 enhanced;
        enhanced.data = out->enhanced_n;
        enhanced_->publish(enhanced);
        if (out->ruptured) {
            std_msgs::msg::UInt32 ruptures;
            ruptures.data = out->ruptures;
            ruptures_->publish(ruptures);
        }
    }

    std::string axis_;
    PairedEnhancer enhancer_;
    rclcpp::Publisher<std_msgs::msg::Float64>::SharedPtr enhanced_;
    rclcpp::Publisher<std_msgs::msg::UInt32>::SharedPtr ruptures_;
    rclcpp::Subscription<geometry_msgs::msg::TwistStamped>::SharedPtr tip_;
    rclcpp::Subscription<geometry_msgs::msg::WrenchStamped>::SharedPtr wrench_;
};

int main(int argc, char **argv) {
    rclcpp::init(argc, argv);
    rclcpp::spin(std::make_shared<StyletNode>());
    rclcpp::shutdown();
    return 0;
}
