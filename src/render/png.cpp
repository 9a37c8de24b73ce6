#include <fmt/format.h>
#include <png.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <system_error>

#include "lamina/error.h"
#include "lamina/render.h"

namespace lamina {
namespace {

// A file under another name that vanishes unless it is kept.
class UnfinishedFile {
 public:
  explicit UnfinishedFile(const std::string& final_path)
      : path_(fmt::format("{}.{}.part", final_path, getpid())), file_(std::fopen(path_.c_str(), "wb")) {}
  ~UnfinishedFile() {
    if (file_ != nullptr) std::fclose(file_);
    if (!kept_) std::remove(path_.c_str());
  }
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;
  [[nodiscard]] std::FILE* get() const { return file_; }
  [[nodiscard]] bool keep_as(const std::string& final_path) {
    const bool closed = std::fclose(file_) == 0;
    file_ = nullptr;
    kept_ = closed && std::rename(path_.c_str(), final_path.c_str()) == 0;
    return kept_;
  }

 private:
  std::string path_;
  std::FILE* file_;
  bool kept_ = false;
};

[[noreturn]] void refuse(const std::string& path, std::string_view why) {
  throw Error(ExitCode::budget,
              fmt::format("cannot write picture '{}': {}; name a folder that can be written", path, why));
}

void encode(const Image& image, std::FILE* file, const std::string& path) {
  png_image header = {};
  header.version = PNG_IMAGE_VERSION;
  header.width = static_cast<png_uint_32>(image.width);
  header.height = static_cast<png_uint_32>(image.height);
  header.format = PNG_FORMAT_RGB;
  if (png_image_write_to_stdio(&header, file, 0, image.pixels.data(), 0, nullptr) == 0) refuse(path, header.message);
  if (std::fflush(file) != 0) refuse(path, std::strerror(errno));
}

}  // namespace

void write_png(const Image& image, const std::string& path) {
  if (path == "-") {
    encode(image, stdout, "standard output");
    return;
  }
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) refuse(path, "it is a folder");
  UnfinishedFile file(path);
  if (file.get() == nullptr) refuse(path, std::strerror(errno));
  encode(image, file.get(), path);
  if (!file.keep_as(path)) refuse(path, std::strerror(errno));
}

}  // namespace lamina
