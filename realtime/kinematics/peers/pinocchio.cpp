// Pose and Jacobian by pinocchio, headers only. Usage: pinocchio FOLDER; reads FOLDER/ROBOT_chain.csv
// and FOLDER/ROBOT_fk.csv, then answers nanoseconds a call for each line "ROBOT CASE".
#include <algorithm>
#include <chrono>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <pinocchio/multibody.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>

namespace pin = pinocchio;

static std::vector<std::vector<double>> rows(const std::string& file, int skip) {
  std::ifstream in(file);
  std::string line, field;
  std::vector<std::vector<double>> all;
  std::getline(in, line);
  while (std::getline(in, line)) {
    std::istringstream fields(line);
    std::vector<double> row;
    for (int k = 0; std::getline(fields, field, ','); ++k)
      if (k >= skip) row.push_back(field.empty() ? 0.0 : std::stod(field));
    all.push_back(row);
  }
  return all;
}

static pin::SE3 pose(const std::vector<double>& n) {
  const Eigen::Quaterniond q(n[6], n[3], n[4], n[5]);
  return pin::SE3(q.normalized().toRotationMatrix(), Eigen::Vector3d(n[0], n[1], n[2]));
}

struct Robot {
  pin::Model model;
  pin::FrameIndex tool;
  std::vector<Eigen::VectorXd> positions;

  Robot(const std::string& folder, const std::string& name) {
    const auto chain = rows(folder + "/" + name + "_chain.csv", 1);
    pin::JointIndex parent = 0;
    for (size_t k = 0; k + 1 < chain.size(); ++k) {
      const auto& row = chain[k];
      const std::string joint = "joint" + std::to_string(k);
      // The joint models pinocchio itself picks when it reads a URDF.
      if (row[7] == 1) parent = model.addJoint(parent, pin::JointModelRX(), pose(row), joint);
      else if (row[8] == 1) parent = model.addJoint(parent, pin::JointModelRY(), pose(row), joint);
      else if (row[9] == 1) parent = model.addJoint(parent, pin::JointModelRZ(), pose(row), joint);
      else parent = model.addJoint(parent, pin::JointModelRevoluteUnaligned(row[7], row[8], row[9]), pose(row), joint);
    }
    tool = model.addFrame(pin::Frame("tool", parent, 0, pose(chain.back()), pin::OP_FRAME));
    for (const auto& row : rows(folder + "/" + name + "_fk.csv", 0))
      positions.push_back(Eigen::Map<const Eigen::VectorXd>(row.data(), model.nq));
  }
};

int main(int, char** arguments) {
  std::map<std::string, Robot> robots;
  for (const std::string name : {"ur5", "panda"}) robots.emplace(name, Robot(arguments[1], name));
  std::cout << "ready" << std::endl;
  std::string line;
  while (std::getline(std::cin, line)) {
    std::istringstream words(line);
    std::string name, what;
    words >> name >> what;
    const Robot& robot = robots.at(name);
    pin::Data data(robot.model);
    pin::Data::Matrix6x jacobian = pin::Data::Matrix6x::Zero(6, robot.model.nv);
    double least = 1e300, sum = 0;
    for (int pass = 0; pass < 20; ++pass) {
      const auto begin = std::chrono::steady_clock::now();
      for (const auto& q : robot.positions) {
        if (what == "forward") {
          pin::forwardKinematics(robot.model, data, q);
          sum += pin::updateFramePlacement(robot.model, data, robot.tool).translation()[0];
        } else if (what == "frame_jacobian") {
          pin::computeFrameJacobian(robot.model, data, q, robot.tool, pin::LOCAL_WORLD_ALIGNED, jacobian);
          sum += jacobian(0, 0) + data.oMf[robot.tool].translation()[0];
        } else {
          pin::computeJointJacobians(robot.model, data, q);
          pin::updateFramePlacement(robot.model, data, robot.tool);
          pin::getFrameJacobian(robot.model, data, robot.tool, pin::LOCAL_WORLD_ALIGNED, jacobian);
          sum += jacobian(0, 0) + data.oMf[robot.tool].translation()[0];
        }
      }
      const std::chrono::duration<double, std::nano> spent = std::chrono::steady_clock::now() - begin;
      least = std::min(least, spent.count() / robot.positions.size());
    }
    // The sum keeps the compiler from leaving the work out.
    std::cout << (sum == 0.123456789 ? 0.0 : least) << std::endl;
  }
}
