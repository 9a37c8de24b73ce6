// The page's text: data, a description, the viewer.
#pragma once
#include <zlib.h>

#include <array>
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace lamina::view {

using PageSink = std::function<void(std::string_view)>;
using PageJson = nlohmann::ordered_json;

/// A page, written from its beginning to its end. Data is deflated and stands in base64 in script elements that no
/// browser runs: a string of hundreds of megabytes is more than some of them hold, so a block is cut into several.
class PageWriter {
 public:
  PageWriter(PageSink sink, const std::string& title);
  ~PageWriter();
  PageWriter(const PageWriter&) = delete;
  PageWriter& operator=(const PageWriter&) = delete;

  /// Data comes between these, in any pieces. `name`: what the viewer asks for it by.
  void begin_block(const std::string& name);
  void add(std::string_view bytes);
  void end_block();
  /// The description and the viewer's code; nothing follows.
  void finish(const PageJson& description, const std::string& bundle);
  [[nodiscard]] std::uint64_t data_bytes() const { return data_bytes_; }

 private:
  void deflate_some(int flush);
  void put(const unsigned char* bytes, std::size_t count);
  void open_element();
  void flush_text();

  PageSink sink_;
  std::string block_, text_;
  std::size_t element_chars_ = 0;  ///< in the open element
  z_stream deflater_{};
  bool deflating_ = false;
  std::array<unsigned char, 3> carried_{};
  std::size_t carried_count_ = 0;
  std::uint64_t data_bytes_ = 0;
};

/// The viewer's code. Throws Error(unreadable) naming the file.
std::string read_bundle(const std::string& path);

}  // namespace lamina::view
