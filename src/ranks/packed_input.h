// What ranks tell each other of the input.
#pragma once
#include <array>
#include <vector>

#include "lamina/frame.h"
#include "lamina/points.h"
#include "ranks/bytes.h"
#include "store/survey.h"

namespace lamina::ranks {

inline void put(Packer& out, const PointSourceInfo& info) {
  out.put(info.path);
  out.put(info.count);
  for (const bool flag : {info.has_normals, info.has_radius, info.has_quality}) out.put(flag);
  out.put(info.attributes.size());
  for (const AttributeSpec& a : info.attributes) {
    out.put(a.name);
    out.put(a.type);
  }
}

inline PointSourceInfo get_info(Unpacker& in) {
  PointSourceInfo info;
  info.path = in.get_text();
  info.count = in.get<std::uint64_t>();
  for (bool* flag : {&info.has_normals, &info.has_radius, &info.has_quality}) *flag = in.get<bool>();
  const auto attributes = in.get<std::size_t>();
  for (std::size_t a = 0; a < attributes; ++a) {
    const std::string name = in.get_text();
    info.attributes.push_back({name, in.get<ScalarType>()});
  }
  return info;
}

inline void put(Packer& out, const Eigen::Vector3d& v) {
  for (int k = 0; k < 3; ++k) out.put(v[k]);
}

inline Eigen::Vector3d get_vector(Unpacker& in) {
  const auto x = in.get<double>(), y = in.get<double>(), z = in.get<double>();
  return {x, y, z};
}

inline void put(Packer& out, const Census& c) {
  out.put(c.usable);
  out.put(c.rejected);
  out.put(c.first_row);
  put(out, c.low);
  put(out, c.high);
  out.put(c.max_quality);
  out.put(c.unusable_attributes);
  out.put(c.first_unusable_attribute);
}

inline Census get_census(Unpacker& in) {
  Census c;
  c.usable = in.get<std::uint64_t>();
  c.rejected = in.get<std::array<std::uint64_t, kDefects>>();
  c.first_row = in.get<std::array<std::uint64_t, kDefects>>();
  c.low = get_vector(in);
  c.high = get_vector(in);
  c.max_quality = in.get<float>();
  c.unusable_attributes = in.get<std::uint64_t>();
  c.first_unusable_attribute = in.get<std::uint64_t>();
  return c;
}

inline void put(Packer& out, const Frame& frame) {
  put(out, frame.origin);
  for (int r = 0; r < 3; ++r) put(out, Eigen::Vector3d(frame.rotation.row(r)));
  out.put(frame.step);
}

inline Frame get_frame(Unpacker& in) {
  Frame frame;
  frame.origin = get_vector(in);
  for (int r = 0; r < 3; ++r) frame.rotation.row(r) = get_vector(in);
  frame.step = in.get<double>();
  return frame;
}

}  // namespace lamina::ranks
