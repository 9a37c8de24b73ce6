#include "view/page_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <fstream>
#include <new>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>

#include "lamina/error.h"

namespace lamina::view {
namespace {

constexpr std::size_t kElementChars = 16u << 20;
constexpr std::size_t kTextChars = 1u << 20;

std::string html_text(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    if (c == '&')
      safe += "&amp;";
    else if (c == '<')
      safe += "&lt;";
    else if (c == '>')
      safe += "&gt;";
    else if (c == '"')
      safe += "&quot;";
    else
      safe += c;
  }
  return safe;
}

/// JSON that no name in it can end early: there is no < in it.
std::string script_json(const PageJson& json) {
  const std::string text = json.dump(-1, ' ', false, PageJson::error_handler_t::replace);
  std::string safe;
  for (const char c : text) {
    if (c == '<')
      safe += "\\u003c";
    else
      safe += c;
  }
  return safe;
}

}  // namespace

PageWriter::PageWriter(PageSink sink, const std::string& title) : sink_(std::move(sink)) {
  sink_(fmt::format(
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta name=\"generator\" content=\"lamina " LAMINA_VERSION
      "\">\n<link rel=\"icon\" href=\"data:,\">\n<title>{}</title>\n"
      "<style>html{{background:#17191d;color:#d8dbe0;font:14px system-ui,sans-serif}}</style>\n</head>\n<body>\n"
      "<noscript>This page shows its model with JavaScript and WebGL 2, without any network.</noscript>\n",
      html_text(title)));
}

PageWriter::~PageWriter() {
  if (deflating_) deflateEnd(&deflater_);
}

void PageWriter::begin_block(const std::string& name) {
  block_ = html_text(name);
  deflater_ = {};
  // Floats seldom repeat: more effort than this takes three times as long for some hundredths.
  constexpr int kLevel = 4, kGzip = 16;
  if (deflateInit2(&deflater_, kLevel, Z_DEFLATED, MAX_WBITS + kGzip, 8, Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::bad_alloc();
  deflating_ = true;
  open_element();
}

void PageWriter::add(std::string_view bytes) {
  data_bytes_ += bytes.size();
  constexpr std::size_t kMost = 1u << 30;  // zlib counts in 32 bits
  while (!bytes.empty()) {
    const std::string_view piece = bytes.substr(0, kMost);
    bytes.remove_prefix(piece.size());
    deflater_.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(piece.data()));  // zlib does not write there
    deflater_.avail_in = static_cast<uInt>(piece.size());
    deflate_some(Z_NO_FLUSH);
  }
}

void PageWriter::end_block() {
  deflate_some(Z_FINISH);
  deflateEnd(&deflater_);
  deflating_ = false;
  if (carried_count_ > 0) {
    const std::size_t count = std::exchange(carried_count_, 0);
    std::fill(carried_.begin() + static_cast<std::ptrdiff_t>(count), carried_.end(), static_cast<unsigned char>(0));
    const std::array<unsigned char, 3> last = carried_;
    put(last.data(), last.size());
    for (std::size_t k = 0; k < 3 - count; ++k) text_[text_.size() - 1 - k] = '=';
  }
  text_ += "</script>\n";
  flush_text();
}

void PageWriter::deflate_some(int flush) {
  std::array<unsigned char, 1 << 16> packed{};
  int result = Z_OK;
  do {
    deflater_.next_out = packed.data();
    deflater_.avail_out = static_cast<uInt>(packed.size());
    result = deflate(&deflater_, flush);
    put(packed.data(), packed.size() - deflater_.avail_out);
  } while (deflater_.avail_out == 0 || (flush == Z_FINISH && result != Z_STREAM_END));
}

void PageWriter::put(const unsigned char* bytes, std::size_t count) {
  static constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (std::size_t i = 0; i < count; ++i) {
    carried_[carried_count_++] = bytes[i];
    if (carried_count_ < carried_.size()) continue;
    carried_count_ = 0;
    if (element_chars_ >= kElementChars) {
      text_ += "</script>\n";
      open_element();
    }
    if (text_.size() >= kTextChars) flush_text();
    const std::uint32_t bits = static_cast<std::uint32_t>(carried_[0] << 16 | carried_[1] << 8 | carried_[2]);
    for (const int shift : {18, 12, 6, 0}) text_ += kDigits[bits >> shift & 63];
    element_chars_ += 4;
  }
}

void PageWriter::open_element() {
  text_ += fmt::format("<script type=\"text/plain\" data-block=\"{}\">", block_);
  element_chars_ = 0;
}

void PageWriter::flush_text() {
  sink_(text_);
  text_.clear();
}

void PageWriter::finish(const PageJson& description, const std::string& bundle) {
  sink_(
      fmt::format("<script type=\"application/json\" id=\"lamina\">{}</script>\n<script>\n", script_json(description)));
  sink_(bundle);
  sink_("\n</script>\n</body>\n</html>\n");
}

std::string read_bundle(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file || text.str().empty()) throw Error(ExitCode::unreadable, path + ": the viewer's code cannot be read");
  return text.str();
}

}  // namespace lamina::view
