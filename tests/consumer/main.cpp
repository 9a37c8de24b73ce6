// Points to a mesh in a dozen lines; the README shows this file.
#include <iostream>
#include <string_view>

#include "lamina/error.h"
#include "lamina/run.h"
#include "lamina/surface.h"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  lamina::SurfaceSettings settings;
  settings.input = argv[1];
  settings.output = argv[2];
  settings.blend = 2;  // a wide support, for noise
  lamina::RunContext run;
  run.log = [](lamina::LogLevel, std::string_view text) { std::cerr << text << '\n'; };
  try {
    const lamina::SurfaceStats stats = lamina::reconstruct_surface(settings, run);
    std::cout << stats.vertices << " vertices, " << stats.triangles << " triangles\n";
  } catch (const lamina::Error& error) {
    std::cerr << error.what() << '\n';
    return static_cast<int>(error.code());
  }
}
