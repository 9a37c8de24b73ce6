// Whole .vdb files in memory: read, chosen from, made and written, with what their grids say of themselves; and whether
// a file's lengths are true, before OpenVDB believes them.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <istream>
#include <string>
#include <string_view>

#include "lamina/attributes.h"
#include "vdb/grids.h"

namespace lamina::volume {

struct VdbFile {
  openvdb::GridPtrVec grids;  ///< in the order of their names
  std::string version;        ///< library.file
  std::uint64_t bytes = 0;
};

/// Throws Error(unreadable) naming the file and what is wrong: missing, truncated, not a .vdb, no grids.
VdbFile read_vdb(const std::string& path);

/// What a grid is, for messages: "a level set", "points", "a fog volume", "vec3s values".
std::string kind_of(const openvdb::GridBase& grid);

/// "surface (a level set), Cd (vec3s values)".
std::string list_of(const openvdb::GridPtrVec& grids);

/// The grid called `name` or, where that is empty, the fittest: the largest fitness(grid, false). It must be fit,
/// linear and not empty; a named one must have fitness(grid, true) > 0. `wanted`: a word for such grids. Throws
/// Error(unreadable).
openvdb::GridBase::Ptr choose_grid(const std::string& path, const openvdb::GridPtrVec& grids, const std::string& name,
                                   const std::string& wanted,
                                   const std::function<int(const openvdb::GridBase&, bool)>& fitness);
/// Float or double.
bool is_scalar(const openvdb::GridBase& grid);

/// A float or double grid as floats; null when it is neither.
openvdb::FloatGrid::Ptr as_float(const openvdb::GridBase::Ptr& grid);

/// The colours among the grids, `Cd`; null where there are none.
openvdb::Vec3SGrid::ConstPtr colours_of(const openvdb::GridPtrVec& grids);

/// Colours of this type are divided by it to be 0..1, as `Cd` holds them.
constexpr float full_range(ScalarType type) {
  return type == ScalarType::uint8 ? 255.0F : type == ScalarType::uint16 ? 65535.0F : 1.0F;
}

/// The metadata that says where a level set is known.
inline constexpr const char* kOpenMetadata = "open";
bool is_open(const openvdb::GridBase& grid);

/// Name, creator and precision of a grid about to be written.
void label(openvdb::GridBase& grid, const std::string& name, bool half);
/// Metadata `shift`: what to add to the grid's coordinates to get the input's.
void note_shift(openvdb::GridBase& grid, const std::array<double, 3>& shift);

/// Metadata `crs`: the coordinate reference system, where there is one.
void note_crs(openvdb::GridBase& grid, const std::string& crs);

/// Writes the grids beside `path`, then renames; "-" is standard output. Returns the size in bytes.
std::uint64_t write_vdb(const openvdb::GridCPtrVec& grids, const std::string& path);

/// A .vdb file of the grids, Blosc-compressed. Unlike OpenVDB's own writer, which draws a random tag for each file, the
/// tag is made from the contents: equal grids give equal bytes.
std::string vdb_bytes(const openvdb::GridCPtrVec& grids);

/// A file's tag, a UUID in text, stands behind magic number, three version numbers and a flag.
inline constexpr std::size_t kTagAt = 8 + 3 * 4 + 1;
inline constexpr std::size_t kTagSize = 36;

/// The tag made from the contents. Takes the file in pieces of any size, its tag as zeros.
class ContentTag {
 public:
  void add(std::string_view bytes);
  [[nodiscard]] std::string text() const;

 private:
  void mix(std::uint64_t word);

  std::uint64_t a_ = 0xcbf29ce484222325ULL, b_ = 0x84222325cbf29ce4ULL;
  std::uint64_t word_ = 0;    ///< bytes that make no eight yet
  std::uint64_t length_ = 0;  ///< of all pieces
};

/// Names of files that load as the frames of a sequence: out.vdb, 3 -> out.0003.vdb
std::string numbered(const std::string& path, std::size_t number);

/// Walks through the file as OpenVDB's reader will: every length must fit into the file and every compressed piece must
/// hold as many bytes as its node wants, where the reader would run over the end of its arrays. Values are not
/// looked at; of grids of types that OpenVDB does not come with only what precedes the tree is. Throws
/// std::runtime_error saying what is wrong, std::ios::failure where the file ends too early. The stream has exceptions
/// on, stands at the file's beginning, and stands there again afterwards.
void check_vdb(std::istream& file);

/// Throws std::runtime_error.
[[noreturn]] void wrong(const std::string& what);

/// Reads forward, never past the end: throws std::ios::failure there, as the stream does.
class Walker {
 public:
  explicit Walker(std::istream& file) : file_(file) {
    file_.seekg(0, std::ios::end);
    left_ = static_cast<std::uint64_t>(file_.tellg());
    size_ = left_;
    file_.seekg(0);
  }
  void skip(std::uint64_t bytes) {
    take(bytes);
    // Seeking throws the stream's buffer away.
    std::array<char, 4096> unused;
    if (bytes <= unused.size())
      file_.read(unused.data(), static_cast<std::streamsize>(bytes));
    else
      file_.seekg(static_cast<std::streamoff>(bytes), std::ios::cur);
  }
  void read(void* to, std::uint64_t bytes) {
    take(bytes);
    file_.read(static_cast<char*>(to), static_cast<std::streamsize>(bytes));
  }
  template <class T>
  T number() {
    T value{};
    read(&value, sizeof value);
    return value;
  }
  std::string text();
  void go_to(std::int64_t place);
  [[nodiscard]] std::uint64_t left() const { return left_; }

 private:
  void take(std::uint64_t bytes) {
    if (bytes > left_) throw std::ios::failure("the end");
    left_ -= bytes;
  }
  std::istream& file_;
  std::uint64_t left_ = 0, size_ = 0;
};

/// A compressed piece of so many bytes, which must be sound; returns the size of what is in it.
std::uint64_t check_blosc(Walker& w, std::uint64_t bytes);
/// The same for a piece that is unpacked to see whether it can be.
std::uint64_t unpack_blosc(Walker& w, std::uint64_t bytes);
/// Whether a piece of so many bytes is that of an array: short ones are filled up before they are compressed.
bool holds(std::uint64_t unpacked, std::uint64_t bytes);

/// OpenVDB reads metadata by its type, whatever length stands before it. Returns whether it says that values are saved
/// with 16 bits.
bool check_metadata(Walker& w);

/// Walks through the passes in which OpenVDB writes the attributes of so many leaves, from behind the tree's topology
/// to the grid's end: arrays must be as long as they say, pages must hold what is taken out of them, and compressed
/// pieces must be sound. Throws as check_vdb() does. `version` of the file.
void check_points(Walker& w, std::uint64_t leaves, std::uint32_t version);

}  // namespace lamina::volume
