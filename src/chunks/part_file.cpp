#include "chunks/part_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <zlib.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <utility>

#include "base/number.h"
#include "boundary/boundary.h"
#include "lamina/chunk.h"
#include "lamina/error.h"
#include "meshes/mesh_sink.h"

namespace lamina {
namespace {

constexpr std::string_view kMagic("lamina part 4\n\0\0", 16);
constexpr std::string_view kEnd = "complete";
static_assert(kMagic.size() == 16 && kEnd.size() == 8);
constexpr std::size_t kMagicName = 12;  ///< without the version

constexpr std::uint64_t kVertices = 1, kTriangles = 2, kRims = 3;
constexpr std::size_t kBufferBytes = 1 << 20;
constexpr std::size_t kEncoded = 4096;  ///< vertices encoded at once
constexpr std::size_t kTailBytes = sizeof(std::uint64_t) + sizeof(std::uint32_t) + kEnd.size();

std::uint32_t checksum(std::uint32_t before, const void* data, std::size_t bytes) {
  return static_cast<std::uint32_t>(::crc32_z(before, static_cast<const Bytef*>(data), bytes));
}

/// Hands over the vertices' records, some at a time.
template <class Take>
void encode(const VertexBatch& vertices, const MeshSinkSettings& layout, const Take& take) {
  const std::size_t record = vertex_record_bytes(layout.attributes, layout.double_positions);
  std::vector<std::byte> bytes(kEncoded * record);
  for (std::size_t done = 0; done < vertices.size(); done += kEncoded) {
    const std::size_t n = std::min(kEncoded, vertices.size() - done);
    encode_vertices(vertices, layout.attributes, layout.double_positions, done, n, bytes.data());
    take(bytes.data(), n * record);
  }
}

nlohmann::json to_json(const SlabMark& mark) {
  return {{"vertices", mark.vertices}, {"checksum", mark.checksum}};
}

SlabMark mark_from(const nlohmann::json& j) {
  return {j.at("vertices").get<std::uint64_t>(), j.at("checksum").get<std::uint32_t>()};
}

nlohmann::json to_json(const PartInfo& info) {
  nlohmann::json attributes = nlohmann::json::array();
  for (const AttributeSpec& a : info.attributes) attributes.push_back({{"name", a.name}, {"type", ply_name(a.type)}});
  return {{"job", info.job},
          {"number", info.number},
          {"count", info.count},
          {"slabs", {info.span.begin, info.span.end}},
          {"double_positions", info.double_positions},
          {"attributes", attributes},
          {"comments", info.comments},
          {"close_holes", info.holes.longest},
          {"watertight", static_cast<int>(info.holes.watertight)},
          {"bridge", info.holes.bridge},
          {"mark_filled", info.holes.mark},
          {"fill_all", info.holes.all},
          {"deviation", info.deviation},
          {"vertices", info.vertices},
          {"triangles", info.triangles},
          {"below", to_json(info.below)},
          {"last", to_json(info.last)}};
}

PartInfo info_from(const nlohmann::json& j) {
  PartInfo info;
  info.job = j.at("job").get<std::uint64_t>();
  info.number = j.at("number").get<int>();
  info.count = j.at("count").get<int>();
  info.span = {j.at("slabs").at(0).get<std::int32_t>(), j.at("slabs").at(1).get<std::int32_t>()};
  info.double_positions = j.at("double_positions").get<bool>();
  for (const auto& a : j.at("attributes")) {
    const auto type = ply_type(a.at("type").get<std::string>());
    if (!type) throw std::invalid_argument("type");
    info.attributes.push_back({a.at("name").get<std::string>(), *type});
  }
  info.comments = j.at("comments").get<std::vector<std::string>>();
  info.holes = {j.at("close_holes").get<double>(), static_cast<Watertight>(j.at("watertight").get<int>()),
                j.at("bridge").get<bool>(), j.at("mark_filled").get<bool>(), j.at("fill_all").get<bool>()};
  info.deviation = j.at("deviation").get<double>();
  info.vertices = j.at("vertices").get<std::uint64_t>();
  info.triangles = j.at("triangles").get<std::uint64_t>();
  info.below = mark_from(j.at("below"));
  info.last = mark_from(j.at("last"));
  return info;
}

}  // namespace

bool is_part(const std::string& path) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  std::array<char, kMagicName> magic{};
  return file && pread_all(file.get(), magic.data(), magic.size(), 0).bytes == magic.size() &&
         std::string_view(magic.data(), magic.size()) == kMagic.substr(0, kMagicName);
}

SlabMark mark_of(const VertexBatch& vertices, const MeshSinkSettings& layout) {
  SlabMark mark{vertices.size(), 0};
  encode(vertices, layout,
         [&](const std::byte* data, std::size_t bytes) { mark.checksum = checksum(mark.checksum, data, bytes); });
  return mark;
}

PartWriter::PartWriter(const std::string& path, const MeshSinkSettings& layout) : file_(path, {}), layout_(layout) {
  buffer_.reserve(kBufferBytes);
  put(kMagic.data(), kMagic.size());
}

void PartWriter::put(const void* data, std::size_t bytes) {
  const auto* from = static_cast<const std::byte*>(data);
  buffer_.insert(buffer_.end(), from, from + bytes);
  if (buffer_.size() >= kBufferBytes) flush();
}

void PartWriter::flush() {
  if (const int error = write_all(file_.fd(), buffer_.data(), buffer_.size()); error != 0)
    report_write_error(file_.name(), error);
  written_ += buffer_.size();
  buffer_.clear();
}

void PartWriter::add(const VertexBatch& vertices, std::span<const PartTriangle> triangles) {
  require_writable(vertices, layout_.attributes, layout_.double_positions, vertices_);
  last_ = {vertices.size(), 0};
  if (vertices.size() > 0) {
    begin_block(kVertices, vertices.size());
    encode(vertices, layout_, [&](const std::byte* data, std::size_t bytes) {
      last_.checksum = checksum(last_.checksum, data, bytes);
      put(data, bytes);
    });
    put(&last_.checksum, sizeof last_.checksum);
  }
  if (!triangles.empty()) {
    begin_block(kTriangles, triangles.size());
    std::uint32_t sum = 0;
    for (std::size_t done = 0; done < triangles.size(); done += kEncoded) {
      const auto piece = std::as_bytes(triangles.subspan(done, std::min(kEncoded, triangles.size() - done)));
      sum = checksum(sum, piece.data(), piece.size());
      put(piece.data(), piece.size());
    }
    put(&sum, sizeof sum);
  }
  vertices_ += vertices.size();
  triangles_ += triangles.size();
}

void PartWriter::begin_block(std::uint64_t kind, std::uint64_t count) {
  put(&kind, sizeof kind);
  put(&count, sizeof count);
}

void PartWriter::add(const boundary::BoundaryBatch& rims) {
  if (rims.empty()) return;
  packed_.clear();
  boundary::pack(rims, packed_);
  begin_block(kRims, packed_.size());
  put(packed_.data(), packed_.size());
  const std::uint32_t sum = checksum(0, packed_.data(), packed_.size());
  put(&sum, sizeof sum);
}

void PartWriter::commit(PartInfo info) {
  info.vertices = vertices_;
  info.triangles = triangles_;
  info.last = last_;
  info.attributes = layout_.attributes;
  info.double_positions = layout_.double_positions;
  info.comments = layout_.comments;
  const std::string text = to_json(info).dump();
  const std::uint64_t length = text.size();
  const std::uint32_t sum = checksum(0, text.data(), text.size());
  put(text.data(), text.size());
  put(&length, sizeof length);
  put(&sum, sizeof sum);
  put(kEnd.data(), kEnd.size());
  flush();
  file_.publish();
}

PartReader::PartReader(const std::string& path) : path_(path), file_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
  if (!file_) refuse(fmt::format("cannot be read: {}", system_message(errno)));
  struct stat status {};
  if (::fstat(file_.get(), &status) != 0 || !S_ISREG(status.st_mode)) refuse("is no file");
  const auto size = static_cast<std::uint64_t>(status.st_size);
  std::array<char, kMagic.size()> magic{};
  if (size < magic.size()) refuse("is no part of a mesh, or truncated");
  read(0, magic.data(), magic.size());
  const std::string_view found(magic.data(), magic.size());
  if (found.substr(0, kMagicName) != kMagic.substr(0, kMagicName)) refuse("is no part of a mesh");
  if (found != kMagic)
    refuse("is a part in a format that this version of lamina does not know; make and merge parts with one version");
  const char* const truncated = "is truncated: make the chunk again";
  if (size < kMagic.size() + kTailBytes) refuse(truncated);
  std::array<char, kTailBytes> tail{};
  read(size - kTailBytes, tail.data(), tail.size());
  if (std::string_view(tail.data() + kTailBytes - kEnd.size(), kEnd.size()) != kEnd) refuse(truncated);
  std::uint64_t length = 0;
  std::uint32_t sum = 0;
  std::memcpy(&length, tail.data(), sizeof length);
  std::memcpy(&sum, tail.data() + sizeof length, sizeof sum);
  constexpr std::uint64_t kLongest = 64 << 20;
  if (length > size - kTailBytes - kMagic.size() || length > kLongest) refuse("is damaged at its end");
  body_end_ = size - kTailBytes - length;
  std::string text(length, '\0');
  read(body_end_, text.data(), text.size());
  if (checksum(0, text.data(), text.size()) != sum) refuse("is damaged at its end");
  try {
    info_ = info_from(nlohmann::json::parse(text));
  } catch (const std::exception&) {
    refuse("is damaged at its end");
  }
}

void PartReader::refuse(const std::string& what) const {
  throw Error(ExitCode::unreadable, fmt::format("{}: {}", path_, what));
}

void PartReader::read(std::uint64_t offset, void* data, std::size_t bytes) const {
  const ReadResult got = pread_all(file_.get(), data, bytes, offset);
  if (got.error != 0) refuse(fmt::format("cannot be read: {}", system_message(got.error)));
  if (got.bytes < bytes) refuse("is truncated: make the chunk again");
}

void PartReader::read_blocks(std::uint64_t kind, std::size_t record,
                             const std::function<void(std::span<const std::byte>)>& take) const {
  const std::size_t vertex = vertex_record_bytes(info_.attributes, info_.double_positions);
  std::vector<std::byte> buffer(std::max<std::size_t>(1, kBufferBytes / record) * record);
  std::uint64_t count = 0;
  const auto damaged = [&](std::uint64_t at) {
    refuse(fmt::format("is damaged at byte {}: make the chunk again", at));
  };
  for (std::uint64_t at = kMagic.size(); at < body_end_;) {
    std::array<std::uint64_t, 2> head{};
    if (body_end_ - at < sizeof head + sizeof(std::uint32_t)) damaged(at);
    read(at, head.data(), sizeof head);
    const std::size_t bytes_each = head[0] == kVertices ? vertex : head[0] == kTriangles ? sizeof(PartTriangle) : 1;
    if (head[0] < kVertices || head[0] > kRims ||
        head[1] > (body_end_ - at - sizeof head - sizeof(std::uint32_t)) / bytes_each)
      damaged(at);
    const std::uint64_t bytes = head[1] * bytes_each;
    const std::uint64_t block = at;
    at += sizeof head;
    if (head[0] == kind) {
      std::uint32_t sum = 0;
      for (std::uint64_t done = 0; done < bytes;) {
        const std::size_t n = std::min<std::uint64_t>(buffer.size(), bytes - done);
        read(at + done, buffer.data(), n);
        sum = checksum(sum, buffer.data(), n);
        take(std::span(buffer).first(n));
        done += n;
      }
      std::uint32_t stored = 0;
      read(at + bytes, &stored, sizeof stored);
      if (stored != sum) damaged(block);
      count += head[1];
    }
    at += bytes + sizeof(std::uint32_t);
  }
  if (kind != kRims && count != (kind == kVertices ? info_.vertices : info_.triangles)) damaged(body_end_);
}

void PartReader::read_vertices(const std::function<void(std::span<const std::byte>)>& take) const {
  read_blocks(kVertices, vertex_record_bytes(info_.attributes, info_.double_positions), take);
}

void PartReader::read_triangles(const std::function<void(std::span<const PartTriangle>)>& take) const {
  std::vector<PartTriangle> triangles;
  read_blocks(kTriangles, sizeof(PartTriangle), [&](std::span<const std::byte> bytes) {
    triangles.resize(bytes.size() / sizeof(PartTriangle));
    std::memcpy(triangles.data(), bytes.data(), bytes.size());
    take(triangles);
  });
}

boundary::BoundaryBatch PartReader::read_boundary() const {
  std::vector<std::byte> all;
  read_blocks(kRims, 1, [&](std::span<const std::byte> bytes) { all.insert(all.end(), bytes.begin(), bytes.end()); });
  return boundary::unpack(all);
}

void make_relative(const std::vector<std::array<std::uint32_t, 3>>& triangles, std::uint64_t first, std::uint64_t below,
                   std::vector<PartTriangle>& out) {
  out.resize(triangles.size());
  // Clusterers count in 32 bits, whatever number the part begins with.
  const auto origin = static_cast<std::int64_t>(first);
  std::int64_t least = 0, most = 0;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int64_t number = static_cast<std::int64_t>(triangles[t][k]) - origin;
      least = std::min(least, number);
      most = std::max(most, number);
      out[t][k] = static_cast<std::int32_t>(number);
    }
  }
  if (most > std::numeric_limits<std::int32_t>::max()) {
    throw Error(ExitCode::budget, fmt::format("a part of the mesh has more than {} vertices; cut it into more chunks",
                                              std::numeric_limits<std::int32_t>::max()));
  }
  if (least < -static_cast<std::int64_t>(below)) {
    throw Error(ExitCode::internal,
                "chunk: a triangle reaches back farther than the slab below; this is a defect of "
                "the program, please report it with the command line");
  }
}

PartSlabs::PartSlabs(std::vector<Part> parts, int count, std::uint64_t job, const HoleSettings& holes, double deviation,
                     MeshSinkSettings layout)
    : parts_(std::move(parts)),
      count_(count),
      job_(job),
      holes_(holes),
      deviation_(deviation),
      layout_(std::move(layout)) {}

void PartSlabs::open() {
  writer_.emplace(parts_[at_].path, layout_);
  info_ = {};
  info_.job = job_;
  info_.number = parts_[at_].number;
  info_.count = count_;
  info_.span = parts_[at_].span;
  info_.holes = holes_;
  info_.deviation = deviation_;
  info_.below = previous_;
  first_ = numbered_;
  finder_ = boundary::BoundaryFinder(first_, below_);
}

void PartSlabs::close() {
  if (!writer_) open();  // no slab of it had surface
  boundary_.clear();
  finder_.finish(/*more=*/true, boundary_);
  writer_->add(boundary_);
  writer_->commit(info_);
  vertices_ += writer_->vertices();
  triangles_ += writer_->triangles();
  writer_.reset();
  ++at_;
}

void PartSlabs::finish_below(std::int64_t slab) {
  while (at_ < parts_.size() && parts_[at_].span.end <= slab) close();
}

void PartSlabs::write(const MeshSlab& slab) {
  finish_below(slab.slab);
  if (at_ == parts_.size()) return;
  if (slab.slab >= parts_[at_].span.begin) {
    if (!writer_) open();
    make_relative(slab.triangles, first_, info_.below.vertices, relative_);
    writer_->add(slab.vertices, relative_);
    previous_ = writer_->last();
    boundary_.clear();
    finder_.add(slab.vertices, slab.triangles, boundary_);
    writer_->add(boundary_);
  } else {
    previous_ = mark_of(slab.vertices, layout_);
  }
  below_ = slab.vertices;
  numbered_ += slab.vertices.size();
}

void PartSlabs::finish() {
  finish_below(std::numeric_limits<std::int64_t>::max());
}

}  // namespace lamina
