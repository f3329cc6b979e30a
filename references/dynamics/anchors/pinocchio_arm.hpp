// The arm as a Pinocchio model.
#pragma once
#include <pinocchio/multibody.hpp>

#include "arm.hpp"

inline Eigen::Matrix3d turn(const double* rpy) {
  auto m = rpy_matrix(rpy);
  return Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(m.data());
}

inline pinocchio::Model pinocchio_model(const Arm& arm) {
  pinocchio::Model model;
  pinocchio::JointIndex parent = 0;
  for (int k = 0; k < 6; ++k) {
    const Origin& o = arm.joints[k];
    pinocchio::SE3 place(turn(o.rpy), Eigen::Vector3d(o.xyz[0], o.xyz[1], o.xyz[2]));
    parent = model.addJoint(parent, pinocchio::JointModelRZ(), place, "joint" + std::to_string(k));
    const Link& l = arm.links[k + 1];
    Eigen::Matrix3d j;
    const double* i = l.inertia;
    j << i[0], i[1], i[2], i[1], i[3], i[4], i[2], i[4], i[5];
    Eigen::Matrix3d r = turn(l.origin.rpy);
    const double* c = l.origin.xyz;
    pinocchio::Inertia inertia(l.mass, Eigen::Vector3d(c[0], c[1], c[2]), r * j * r.transpose());
    model.appendBodyToJoint(parent, inertia, pinocchio::SE3::Identity());
  }
  model.gravity.linear() << arm.gravity[0], arm.gravity[1], arm.gravity[2];
  return model;
}
