// A leaf for behaviour trees of BehaviorTree.CPP 4: one tick starts a task in a RISE session (an act, a rule, an event, a
// value), and the leaf runs until the task has ended.
//
// Copy this file into a package of your own, or depend on this one. What you get:
//
// - SUCCESS when the task SUCCEEDED, FAILURE in every other case, with the reason on the port `reason`;
// - halting the leaf (a reactive node, `tree.haltTree()`) cancels the task, also one that was only just sent;
// - no tick that waits, and callbacks that run within ticks only: nobody else has to spin the node, and no lock is needed;
// - FAILURE, and not silence, when there is no session, when it does not answer, and when it goes.
//
//     BT::BehaviorTreeFactory factory;
//     factory.registerNodeType<rise_behavior_tree::TaskLeaf>("RiseTask", node);
//
//     <RiseTask function="startCommunicationRobotAct" behavior="R_Greeting"/>
//
// How it is used: docs/how-to/behaviour-trees.md of rise-tui.

#pragma once

#include <behaviortree_cpp/action_node.h>

#include <chrono>
#include <memory>
#include <optional>
#include <rclcpp/rclcpp.hpp>
#include <rclcpp_action/rclcpp_action.hpp>
#include <rise_interfaces/action/domain_task.hpp>
#include <string>

namespace rise_behavior_tree
{

class TaskLeaf : public BT::StatefulActionNode
{
public:
  using DomainTask = rise_interfaces::action::DomainTask;
  using GoalHandle = rclcpp_action::ClientGoalHandle<DomainTask>;
  using Clock = std::chrono::steady_clock;

  // `node` may be spun by others, or by nobody.
  TaskLeaf(const std::string & name, const BT::NodeConfig & config, const rclcpp::Node::SharedPtr & node)
  : BT::StatefulActionNode(name, config),
    group_(node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive, false))
  {
    executor_.add_callback_group(group_, node->get_node_base_interface());
    // Relative: a namespace or a remapping of the node moves it, as it moves the session's.
    client_ = rclcpp_action::create_client<DomainTask>(node, "rise/domain_task", group_);
  }

  static BT::PortsList providedPorts()
  {
    return {
      BT::InputPort<std::string>(
        "function", "startCommunicationRobotAct", "what is asked for, as DomainTask.action explains it"),
      BT::InputPort<std::string>("behavior", "the act, the rule, the event, or the JSON of a value"),
      BT::InputPort<std::string>("calling_type", "", "Blocking, None, or empty: as the act says"),
      BT::InputPort<double>("patience", 5.0, "seconds that the session has to appear, and again to take the task"),
      BT::OutputPort<std::string>("reason", "how it ended, in a sentence"),
    };
  }

  BT::NodeStatus onStart() override
  {
    task_ = DomainTask::Goal();
    task_.function_type = port<std::string>("function");
    task_.domain_task_behavior = port<std::string>("behavior");
    task_.calling_type = port<std::string>("calling_type");
    patience_ = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(port<double>("patience")));
    goal_.reset();
    deadline_ = Clock::now() + patience_;
    return onRunning();
  }

  BT::NodeStatus onRunning() override
  {
    // Every leaf hears of every task; what came while this one was not ticked must not stand before its own answers.
    executor_.spin_all(std::chrono::milliseconds(10));
    const bool is_ready = client_->action_server_is_ready();
    if (!goal_ && is_ready) {
      send();
    }
    if (goal_ && goal_->result) {
      const auto & result = *goal_->result;
      return end(result.status == "SUCCEEDED", result.reason.empty() ? result.status : result.reason);
    }
    if (goal_ && goal_->is_refused) {
      return end(false, "the session refused the task; rise/task_state and its record say why");
    }
    if (goal_ && !is_ready) {
      return end(false, "the session went before the task had ended");
    }
    if (!(goal_ && goal_->handle) && Clock::now() >= deadline_) {
      return end(false, goal_ ? "the session did not answer" : "no session is there");
    }
    return BT::NodeStatus::RUNNING;
  }

  void onHalted() override
  {
    // A goal can be cancelled only once it has been taken. Whoever halts waits for that and for the answer to the cancel,
    // some milliseconds, and for a session that is stuck a second.
    take_back();
    const auto until = Clock::now() + std::chrono::seconds(1);
    while (goal_ && !goal_->is_over() && !goal_->is_cancelling && rclcpp::ok() && Clock::now() < until) {
      executor_.spin_once(std::chrono::milliseconds(20));
    }
  }

private:
  // One goal, from its sending to its end. A leaf that begins anew has a new one, so what comes late belongs to nobody.
  struct Goal
  {
    GoalHandle::SharedPtr handle;
    std::optional<DomainTask::Result> result;
    bool is_refused = false;
    bool is_unwanted = false;
    bool is_cancelling = false;

    bool is_over() const {return is_refused || result;}
  };

  template<typename T>
  T port(const std::string & name)
  {
    const auto value = getInput<T>(name);
    if (!value) {
      throw BT::RuntimeError(registrationName(), ", port ", name, ": ", value.error());
    }
    return *value;
  }

  void send()
  {
    const auto goal = std::make_shared<Goal>();
    goal_ = goal;
    deadline_ = Clock::now() + patience_;
    rclcpp_action::Client<DomainTask>::SendGoalOptions options;
    options.goal_response_callback = [this, goal](const GoalHandle::SharedPtr & handle) {
        goal->handle = handle;
        goal->is_refused = handle == nullptr;
        if (handle && goal->is_unwanted) {
          cancel(goal);
        }
      };
    options.result_callback = [goal](const GoalHandle::WrappedResult & answer) {
        goal->result = answer.result ? *answer.result : DomainTask::Result();
      };
    client_->async_send_goal(task_, options);
  }

  // Whatever ends the leaf before its task has ended takes the task back.
  void take_back()
  {
    if (!goal_ || goal_->is_over()) {
      return;
    }
    goal_->is_unwanted = true;  // before the session has answered there is nothing to cancel: done with the answer
    if (goal_->handle && rclcpp::ok()) {
      cancel(goal_);
    }
  }

  void cancel(const std::shared_ptr<Goal> & goal)
  {
    client_->async_cancel_goal(goal->handle, [goal](const auto &) {goal->is_cancelling = true;});
  }

  BT::NodeStatus end(bool succeeded, const std::string & why)
  {
    take_back();
    setOutput("reason", why);
    return succeeded ? BT::NodeStatus::SUCCESS : BT::NodeStatus::FAILURE;
  }

  rclcpp::CallbackGroup::SharedPtr group_;  // nobody else keeps it
  rclcpp::executors::SingleThreadedExecutor executor_;
  rclcpp_action::Client<DomainTask>::SharedPtr client_;
  DomainTask::Goal task_;
  std::shared_ptr<Goal> goal_;
  Clock::duration patience_{};
  Clock::time_point deadline_;
};

}  // namespace rise_behavior_tree
