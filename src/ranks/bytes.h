// Values as bytes, for messages between ranks: all run one program on one kind of machine.
#pragma once
#include <cstddef>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "lamina/error.h"

namespace lamina::ranks {

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

}  // namespace lamina::ranks
