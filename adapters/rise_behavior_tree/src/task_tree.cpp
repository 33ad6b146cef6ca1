// Runs a tree from a file beside a RISE session, ten ticks a second, until it has ended; ctrl+c halts it.
//
//     ros2 run rise_behavior_tree task_tree trees/greeting.xml
//
// Exit status: 0 the tree succeeded, 1 it did not, 2 wrong usage or no tree.

#include <behaviortree_cpp/bt_factory.h>
#include <behaviortree_cpp/loggers/bt_cout_logger.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <iostream>
#include <rclcpp/rclcpp.hpp>
#include <string>

#include "rise_behavior_tree/task_leaf.hpp"

namespace
{
std::atomic<bool> is_ending{false};
}

int main(int argc, char ** argv)
{
  // Signals are ours: with rclcpp's own handlers the connection would be gone before the tree could take its task back.
  rclcpp::init(argc, argv, rclcpp::InitOptions(), rclcpp::SignalHandlerOptions::None);
  const auto arguments = rclcpp::remove_ros_arguments(argc, argv);
  for (const int number : {SIGINT, SIGTERM}) {
    std::signal(number, [](int) {is_ending = true;});
  }
  if (arguments.size() != 2) {
    std::cerr << "usage: task_tree TREE.xml" << std::endl;
    return 2;
  }
  const auto node = rclcpp::Node::make_shared("task_tree");
  BT::BehaviorTreeFactory factory;
  factory.registerNodeType<rise_behavior_tree::TaskLeaf>("RiseTask", node);
  BT::Tree tree;
  try {
    tree = factory.createTreeFromFile(arguments[1]);
  } catch (const std::exception & error) {
    std::cerr << "task_tree: " << error.what() << std::endl;
    return 2;
  }
  BT::StdCoutLogger logger(tree);
  auto status = BT::NodeStatus::RUNNING;
  try {
    while (status == BT::NodeStatus::RUNNING && !is_ending) {
      status = tree.tickOnce();
      logger.flush();
      tree.sleep(std::chrono::milliseconds(100));
    }
    if (is_ending) {
      tree.haltTree();
      std::cout << "halted" << std::endl;
    }
  } catch (const std::exception & error) {
    std::cerr << "task_tree: " << error.what() << std::endl;
    status = BT::NodeStatus::FAILURE;
  }
  std::string reason;
  if (tree.rootBlackboard()->get("reason", reason)) {
    std::cout << "the last task: " << reason << std::endl;
  }
  tree = BT::Tree();
  rclcpp::shutdown();
  return status == BT::NodeStatus::SUCCESS ? 0 : 1;
}
