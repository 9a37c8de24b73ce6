#include <fmt/format.h>
#include <png.h>

#include "base/result_file.h"
#include "lamina/error.h"
#include "lamina/render.h"

namespace lamina {

void write_png(const Image& image, const std::string& path) {
  png_image header = {};
  header.version = PNG_IMAGE_VERSION;
  header.width = static_cast<png_uint_32>(image.width);
  header.height = static_cast<png_uint_32>(image.height);
  header.format = PNG_FORMAT_RGB;
  // Encoded in memory: libpng's own file writer would leave half a file under the final name.
  std::string bytes(PNG_IMAGE_PNG_SIZE_MAX(header), '\0');
  png_alloc_size_t size = bytes.size();
  if (png_image_write_to_memory(&header, bytes.data(), &size, 0, image.pixels.data(), 0, nullptr) == 0) {
    throw Error(ExitCode::internal, fmt::format("{}: the picture cannot be encoded: {}", path, header.message));
  }
  bytes.resize(size);
  ResultFile file(path);
  file.write(bytes);
  file.commit();
}

}  // namespace lamina
