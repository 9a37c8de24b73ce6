// A cloud reconstructed whole and in chunks.
#pragma once
#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "base/temporary_folder.h"
#include "lamina/chunk.h"
#include "lamina/error.h"
#include "lamina/surface.h"
#include "reconstruct/clouds.h"

namespace lamina::test {

/// Runs the whole job; the mesh's bytes, or the error's message.
inline std::string whole_bytes(SurfaceSettings settings, const TemporaryFolder& folder) {
  settings.output = folder / "whole.ply";
  try {
    reconstruct_surface(settings, {});
  } catch (const Error& error) {
    return error.what();
  }
  return read_file(settings.output);
}

inline std::string part_name(const TemporaryFolder& folder, int number, int count) {
  return folder / ("part_" + std::to_string(number) + "_of_" + std::to_string(count) + ".lmesh");
}

/// Makes chunks [from, to] of `count` out of a store.
inline std::vector<std::string> make_parts(SurfaceSettings settings, const std::string& store, int count,
                                           const TemporaryFolder& folder) {
  settings.input = store;
  std::vector<std::string> parts;
  for (int number = 1; number <= count; ++number) {
    settings.output = part_name(folder, number, count);
    RunContext run;
    run.threads = 1 + number % 2;
    reconstruct_chunk(settings, {number, count}, run);
    parts.push_back(settings.output);
  }
  return parts;
}

/// Merges the parts, given in another order than theirs.
inline std::string merged_bytes(std::vector<std::string> parts, const TemporaryFolder& folder) {
  std::mt19937 random(7);
  std::shuffle(parts.begin(), parts.end(), random);
  const std::string output = folder / "merged.ply";
  merge_parts(parts, {output}, {});
  return read_file(output);
}

}  // namespace lamina::test
