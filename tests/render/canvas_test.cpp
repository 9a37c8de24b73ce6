#include <gtest/gtest.h>
#include <png.h>

#include <filesystem>
#include <string>

#include "lamina/error.h"
#include "lamina/render.h"
#include "support/program.h"

namespace lamina {
namespace {

Image gradient(int width, int height) {
  Image image{width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (const int c : {x, y, x * y}) image.pixels.push_back(static_cast<std::uint8_t>(c));
    }
  }
  return image;
}

TEST(Png, PixelsComeBack) {
  const test::TemporaryFolder folder;
  const Image image = gradient(37, 21);
  write_png(image, folder / "g.png");
  png_image header = {};
  header.version = PNG_IMAGE_VERSION;
  ASSERT_NE(png_image_begin_read_from_file(&header, (folder / "g.png").c_str()), 0);
  EXPECT_EQ(header.width, 37u);
  EXPECT_EQ(header.height, 21u);
  header.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> pixels(PNG_IMAGE_SIZE(header));
  ASSERT_NE(png_image_finish_read(&header, nullptr, pixels.data(), 0, nullptr), 0);
  EXPECT_EQ(pixels, image.pixels);
}

TEST(Png, NothingIsLeftWhereItCannotBeWritten) {
  const test::TemporaryFolder folder;
  for (const std::string& path : {folder.path(), folder / "missing/g.png"}) {
    try {
      write_png(gradient(4, 4), path);
      ADD_FAILURE() << path;
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ExitCode::budget);
      EXPECT_NE(std::string(e.what()).find(path), std::string::npos);
    }
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace lamina
