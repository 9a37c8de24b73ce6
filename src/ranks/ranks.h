// The few things ranks do together, over MPI. mpi.h is included by ranks_mpi.cpp alone; a program built without MPI has
// no ranks (ranks_none.cpp).
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "lamina/error.h"
#include "lamina/frame.h"
#include "lamina/points.h"
#include "lamina/run.h"
#include "store/ingest.h"

namespace lamina::ranks {

// What ranks tell each other, as bytes: all run one program on one kind of machine.

using Bytes = std::vector<std::byte>;

class Packer {
 public:
  template <class T>
  void put(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    put_raw(&value, sizeof value);
  }
  void put(const std::string& text) {
    put(text.size());
    put_raw(text.data(), text.size());
  }
  template <class T>
  void put(const std::vector<T>& values) {
    static_assert(std::is_trivially_copyable_v<T>);
    put(values.size());
    put_raw(values.data(), values.size() * sizeof(T));
  }
  [[nodiscard]] Bytes take() { return std::move(bytes_); }

 private:
  void put_raw(const void* data, std::size_t size) {
    const auto* from = static_cast<const std::byte*>(data);
    bytes_.insert(bytes_.end(), from, from + size);
  }
  Bytes bytes_;
};

/// In the order they were put.
class Unpacker {
 public:
  explicit Unpacker(std::span<const std::byte> bytes) : left_(bytes) {}
  template <class T>
  T get() {
    static_assert(std::is_trivially_copyable_v<T>);
    T value{};
    get_raw(&value, sizeof value);
    return value;
  }
  std::string get_text() {
    std::string text(get<std::size_t>(), '\0');
    get_raw(text.data(), text.size());
    return text;
  }
  template <class T>
  std::vector<T> get_list() {
    std::vector<T> values(get<std::size_t>());
    get_raw(values.data(), values.size() * sizeof(T));
    return values;
  }

 private:
  void get_raw(void* to, std::size_t size) {
    if (size > left_.size()) throw Error(ExitCode::internal, "ranks: a message is shorter than what it should hold");
    if (size > 0) std::memcpy(to, left_.data(), size);
    left_ = left_.subspan(size);
  }
  std::span<const std::byte> left_;
};

inline void put(Packer& out, const PointSourceInfo& info) {
  out.put(info.path);
  out.put(info.count);
  for (const bool flag : {info.has_normals, info.found_normals, info.has_radius, info.has_quality, tells_scans(info)})
    out.put(flag);
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
  for (bool* flag : {&info.has_normals, &info.found_normals, &info.has_radius, &info.has_quality, &info.scans_told})
    *flag = in.get<bool>();
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

/// Where messages longer than `most` are cut: MPI counts bytes in an int.
inline std::vector<std::size_t> message_lengths(std::size_t bytes, std::size_t most) {
  std::vector<std::size_t> lengths;
  for (; bytes > 0; bytes -= lengths.back()) lengths.push_back(std::min(bytes, most));
  return lengths;
}

/// What a rank's messages came to.
struct Traffic {
  double waited = 0;  ///< seconds, for the other ranks and for messages under way
  std::uint64_t sent = 0, received = 0;
};

/// All ranks the launcher started. Members are collective (all ranks call them, in one order) unless they say
/// otherwise. Waiting ranks sleep, for a processor may have several. One thread at a time; failed_elsewhere() may be
/// asked by another.
class Ranks {
 public:
  /// Begins MPI: once in a process. Throws Error(usage) when the program was built without MPI, or the launcher is of
  /// another MPI.
  Ranks();
  ~Ranks();  ///< ends MPI
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  [[nodiscard]] int rank() const;
  [[nodiscard]] int size() const;
  [[nodiscard]] bool first() const { return rank() == 0; }
  [[nodiscard]] const Traffic& traffic() const;

  /// Runs work that needs no other rank. When it throws on a rank, all ranks throw what the lowest of these has thrown,
  /// in the end: others are told at once (failed_elsewhere()) so that they can leave their work early.
  void together(const std::function<void()>& work);
  /// Whether another rank has failed in together(). May be asked at any time.
  [[nodiscard]] bool failed_elsewhere();

  /// What together() does for others: this rank's work has ended because of another's. At any time.
  void note_failure();

  /// From one rank to one other; not collective. Messages between two ranks come in order.
  void send(int to, const Bytes& bytes);
  Bytes receive(int from);

  /// What rank `from` has; the others' is replaced.
  void broadcast(Bytes& bytes, int from = 0);
  /// On rank 0 what each rank has, elsewhere nothing.
  std::vector<Bytes> gather(const Bytes& bytes);
  /// Element by element over all ranks.
  void sum(std::span<std::uint64_t> values);
  void least(std::span<std::int64_t> values);
  void most(std::span<std::int64_t> values);
  /// Sum over the ranks before this one.
  std::uint64_t sum_before(std::uint64_t value);
  /// to[r] goes to rank r, but for a rank's own; from[r] is what came from it. Both keep their memory.
  void exchange(const std::vector<Bytes>& to, std::vector<Bytes>& from);

 private:
  friend class SharedFile;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// One file that all ranks write (MPI-IO).
class SharedFile {
 public:
  /// Opens `path`, which is there; collective. `name`: for messages. Throws Error(budget) on all ranks when it cannot
  /// be opened on one.
  SharedFile(Ranks& ranks, const std::string& path, std::string name);
  ~SharedFile();
  SharedFile(const SharedFile&) = delete;
  SharedFile& operator=(const SharedFile&) = delete;
  /// Throws Error(budget) naming the file. Not collective.
  void write(std::uint64_t offset, std::span<const std::byte> bytes);
  /// Collective. Throws as write(), on all ranks.
  void close();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lamina::ranks
