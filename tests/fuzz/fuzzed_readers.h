// The readers that are fuzzed, each defined in READER_fuzz.cpp: all return 0, or throw what is wrong.
#pragma once
#include <cstddef>
#include <cstdint>

namespace lamina::fuzz {

int fuzz_e57(const std::uint8_t* data, std::size_t size);
int fuzz_file(const std::uint8_t* data, std::size_t size);
int fuzz_inputs(const std::uint8_t* data, std::size_t size);
int fuzz_las(const std::uint8_t* data, std::size_t size);
int fuzz_laz(const std::uint8_t* data, std::size_t size);
int fuzz_mesh_glb(const std::uint8_t* data, std::size_t size);
int fuzz_mesh_obj(const std::uint8_t* data, std::size_t size);
int fuzz_mesh_off(const std::uint8_t* data, std::size_t size);
int fuzz_mesh_ply(const std::uint8_t* data, std::size_t size);
int fuzz_mesh_stl(const std::uint8_t* data, std::size_t size);
int fuzz_obj(const std::uint8_t* data, std::size_t size);
int fuzz_pcd(const std::uint8_t* data, std::size_t size);
int fuzz_ply(const std::uint8_t* data, std::size_t size);
int fuzz_ptx(const std::uint8_t* data, std::size_t size);
int fuzz_text(const std::uint8_t* data, std::size_t size);
int fuzz_vdb(const std::uint8_t* data, std::size_t size);

}  // namespace lamina::fuzz
