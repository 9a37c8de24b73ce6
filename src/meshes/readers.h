// The formats' readers behind read_mesh(), and the stream they read from: plain and gzip-compressed files, seekable.
#pragma once
#include <zlib.h>

#include <array>
#include <cstdint>
#include <istream>
#include <optional>
#include <streambuf>
#include <string>
#include <vector>

#include "lamina/mesh.h"

namespace lamina::meshes {

/// zlib passes plain files through unchanged, so a reader never asks which kind it has.
class FileBuffer : public std::streambuf {
 public:
  /// "-" is standard input, which must be a file read from its beginning: a pipe cannot be read twice.
  /// Throws Error(unreadable) when `path` is missing, a directory or not permitted.
  explicit FileBuffer(const std::string& path);
  ~FileBuffer() override;
  FileBuffer(const FileBuffer&) = delete;
  FileBuffer& operator=(const FileBuffer&) = delete;

  /// Throws Error(unreadable) when decompression or the disk failed so far: a plain end of file does not look different
  /// to the formats' readers, so they must ask once they are through.
  void require_sound() const;
  /// Bytes on disk (compressed size for .gz).
  [[nodiscard]] std::uint64_t disk_bytes() const { return disk_bytes_; }
  [[nodiscard]] bool compressed() const { return compressed_; }

 protected:
  int_type underflow() override;
  pos_type seekoff(off_type offset, std::ios_base::seekdir way, std::ios_base::openmode which) override;
  pos_type seekpos(pos_type position, std::ios_base::openmode which) override;

 private:
  std::string path_;
  gzFile file_ = nullptr;
  std::vector<char> buffer_;
  std::uint64_t disk_bytes_ = 0;
  bool compressed_ = false;
  std::string failure_;
};

/// PLY in all three encodings, double positions and any scalar attributes kept. Ours, because OpenMesh's reader rounds
/// positions to float and forgets attributes it does not know. Throws Error(unreadable).
TriangleMesh read_ply(FileBuffer& file, const std::string& path);

/// Ours as well: OpenMesh's reader takes a stream's colours and normals only when it has opened the same file by name
/// before.
TriangleMesh read_off(FileBuffer& file, const std::string& path);

/// GLB (binary glTF 2.0) whose data lie in it or beside it: the triangles of its scene, nodes' transforms applied;
/// normals, COLOR_0 as red green blue [alpha], encoded again, and attributes of one number (_NAME). Materials,
/// textures, skins and animations are passed over; geometry in compressing extensions is refused. Throws
/// Error(unreadable).
TriangleMesh read_glb(FileBuffer& file, const std::string& path);

/// Text formats do not say whether their colours reach to 1 or to 255: the largest value does.
void settle_colour_range(TriangleMesh& mesh);

enum class TextFormat { obj, stl };

/// Through OpenMesh's reader of the format, every face kept. Throws Error(unreadable).
TriangleMesh read_with_openmesh(FileBuffer& file, const std::string& path, TextFormat format);

/// What an OBJ or STL file holds by its own account: the yardstick for readers that skip what they cannot parse, and
/// the positions of those that write them out in full, which OpenMesh rounds to float.
struct TextCensus {
  std::optional<std::uint64_t> faces;            ///< unset where the format does not tell
  std::vector<std::array<double, 3>> positions;  ///< OBJ
  bool binary = false;                           ///< STL
};

/// One pass from the start of `file`. Throws Error(unreadable) where the file contradicts itself (a vertex that is
/// not three numbers, binary STL of the wrong length, OBJ with continued lines).
TextCensus take_census(FileBuffer& file, const std::string& path, TextFormat format);

}  // namespace lamina::meshes
