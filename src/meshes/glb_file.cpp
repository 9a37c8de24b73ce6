#include "meshes/glb.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/number.h"
#include "lamina/error.h"

namespace lamina::meshes {
namespace {

std::size_t component_bytes(std::uint64_t component) {
  switch (component) {
    case glb::kByte:
    case glb::kUbyte:
      return 1;
    case glb::kShort:
    case glb::kUshort:
      return 2;
    case glb::kUint:
    case glb::kFloat:
      return 4;
    default:
      return 0;
  }
}

/// Those that say nothing of where vertices lie and how they hang together.
bool is_harmless(std::string_view extension) {
  constexpr std::array<std::string_view, 5> kStarts{"KHR_mesh_quantization", "KHR_texture_", "KHR_materials_",
                                                    "EXT_texture_", "KHR_lights_"};
  return std::any_of(kStarts.begin(), kStarts.end(), [&](std::string_view s) { return extension.starts_with(s); });
}

std::size_t width_of(std::string_view type) {
  if (type == "SCALAR") return 1;
  if (type == "VEC2") return 2;
  if (type == "VEC3") return 3;
  return type == "VEC4" ? 4 : 0;
}

}  // namespace

double GlbAccessor::raw(std::uint64_t row, std::size_t k) const {
  const std::byte* from = data + row * stride + k * component_bytes(component);
  switch (component) {
    case glb::kByte:
      return load_little<std::int8_t>(from);
    case glb::kUbyte:
      return load_little<std::uint8_t>(from);
    case glb::kShort:
      return load_little<std::int16_t>(from);
    case glb::kUshort:
      return load_little<std::uint16_t>(from);
    case glb::kUint:
      return load_little<std::uint32_t>(from);
    case glb::kFloat:
      break;
  }
  return load_little<float>(from);
}

double GlbAccessor::at(std::uint64_t row, std::size_t k) const {
  const double value = raw(row, k);
  if (!normalized) return value;
  switch (component) {
    case glb::kByte:
      return std::max(value / 127, -1.0);
    case glb::kUbyte:
      return value / 255;
    case glb::kShort:
      return std::max(value / 32767, -1.0);
    case glb::kUshort:
      return value / 65535;
    default:
      return value;
  }
}

GlbFile::GlbFile(FileBuffer& file, std::string path) : path_(std::move(path)) {
  if (word(file) != glb::kMagic) fail("is no GLB (it does not begin with \"glTF\")");
  if (const std::uint32_t version = word(file); version != glb::kVersion)
    fail(fmt::format("is glTF of version {}; only version 2 is read", version));
  const std::uint64_t length = word(file);
  bool any = false;
  std::string data;
  while (bytes_ + glb::kChunkHeaderBytes <= length) {
    const std::uint64_t size = word(file);
    const std::uint32_t kind = word(file);
    if (bytes_ + size > length) fail(fmt::format("has a chunk of {} bytes beyond its own end", size));
    std::string chunk = take(file, size);
    if (!any) {
      if (kind != glb::kJsonChunk) fail("does not begin with a JSON chunk");
      json_ = nlohmann::json::parse(chunk, nullptr, false);
      if (!json_.is_object()) fail("its JSON chunk is no JSON object: the file is damaged");
      any = true;
    } else if (kind == glb::kDataChunk && data.empty()) {
      data = std::move(chunk);
    }
  }
  if (!any) fail("has no JSON chunk");
  if (bytes_ != length || file.sgetc() != FileBuffer::traits_type::eof())
    fail("is not as long as its header says: the file is damaged");
  file.require_sound();
  require_extensions();
  read_buffers(std::move(data));
}

std::string GlbFile::take(FileBuffer& file, std::uint64_t bytes) {
  constexpr std::uint64_t kPiece = std::uint64_t{1} << 20;  // a length may lie: nothing is reserved on its word
  std::string taken;
  while (taken.size() < bytes) {
    const std::size_t before = taken.size();
    const std::size_t part = std::min(kPiece, bytes - before);
    taken.resize(before + part);
    const auto got = file.sgetn(taken.data() + before, static_cast<std::streamsize>(part));
    bytes_ += static_cast<std::uint64_t>(std::max<std::streamsize>(got, 0));
    if (got != static_cast<std::streamsize>(part)) {
      file.require_sound();
      fail(fmt::format("ends after {} bytes, before its data do: the file is cut short", bytes_));
    }
  }
  return taken;
}

std::uint32_t GlbFile::word(FileBuffer& file) {
  const std::string bytes = take(file, sizeof(std::uint32_t));
  return load_little<std::uint32_t>(reinterpret_cast<const std::byte*>(bytes.data()));
}

void GlbFile::require_extensions() const {
  for (const nlohmann::json& name : json_.value("extensionsRequired", nlohmann::json::array())) {
    const std::string extension = name.is_string() ? name.get<std::string>() : name.dump();
    if (!is_harmless(extension))
      fail(fmt::format("needs the extension {}, which is not read; write it without compression", extension));
  }
}

void GlbFile::read_buffers(std::string own) {
  buffers_.push_back(std::move(own));
  const nlohmann::json buffers = json_.value("buffers", nlohmann::json::array());
  if (!buffers.is_array()) fail("its \"buffers\" are no list");
  for (std::size_t b = 0; b < buffers.size(); ++b) {
    const auto uri = buffers[b].find("uri");
    if (uri == buffers[b].end()) {
      if (b > 0) fail(fmt::format("says nothing of where buffers[{}] is", b));
      continue;
    }
    buffers_.resize(b + 1);
    buffers_[b] =
        read_beside(uri->is_string() ? uri->get<std::string>() : uri->dump(), whole(buffers[b], "byteLength"));
    bytes_ += buffers_[b].size();
  }
}

/// Of a link to a GLB the data may lie beside either.
std::string GlbFile::read_beside(const std::string& uri, std::uint64_t bytes) const {
  const std::optional<std::string> name = file_of_uri(uri);
  if (!name || path_ == "-") {
    fail(fmt::format("keeps data in {:.60}, where they are not read from; only files in its folder or below are",
                     uri.starts_with("data:") ? "its JSON" : uri));
  }
  namespace fs = std::filesystem;
  std::error_code error;
  fs::path file = fs::path(path_).parent_path() / *name;
  if (!fs::exists(file, error)) file = fs::weakly_canonical(path_, error).parent_path() / *name;
  const bool there = fs::is_regular_file(file, error);
  const std::uint64_t size = there ? fs::file_size(file, error) : 0;
  if (!there || error)
    fail(fmt::format("keeps data in {}, which is not there; the files of a mesh must lie beside each other", *name));
  if (size < bytes) fail(fmt::format("keeps {} bytes in {}, which is cut short: it has {}", bytes, *name, size));
  std::ifstream in(file, std::ios::binary);
  std::string data(bytes, '\0');
  if (!in.read(data.data(), static_cast<std::streamsize>(bytes))) fail(fmt::format("{} cannot be read", *name));
  return data;
}

const nlohmann::json& GlbFile::element(const char* list, std::uint64_t number) const {
  const auto found = json_.find(list);
  if (found == json_.end() || !found->is_array() || number >= found->size() || !(*found)[number].is_object())
    fail(fmt::format("{}[{}] is named but not there", list, number));
  return (*found)[number];
}

std::uint64_t GlbFile::whole(const nlohmann::json& object, const char* key, std::uint64_t otherwise) const {
  const auto found = object.find(key);
  if (found == object.end()) return otherwise;
  constexpr std::uint64_t kMost = std::uint64_t{1} << 40;  // sums and products with it stay within 64 bits
  if (!found->is_number_unsigned() || found->get<std::uint64_t>() > kMost)
    fail(fmt::format("\"{}\" is no whole number that could be meant: {:.40}", key, found->dump()));
  return found->get<std::uint64_t>();
}

std::uint64_t GlbFile::whole(const nlohmann::json& object, const char* key) const {
  if (!object.contains(key)) fail(fmt::format("lacks \"{}\" where it is needed", key));
  return whole(object, key, 0);
}

GlbAccessor GlbFile::accessor(std::uint64_t number) const {
  const nlohmann::json& json = element("accessors", number);
  const auto refuse = [&](const std::string& what) { fail(fmt::format("accessors[{}] {}", number, what)); };
  if (json.contains("sparse") || !json.contains("bufferView")) refuse("is sparse or without data, which is not read");
  const nlohmann::json& view = element("bufferViews", whole(json, "bufferView"));
  GlbAccessor out;
  const std::uint64_t component = whole(json, "componentType");
  const std::size_t bytes = component_bytes(component);
  const auto type = json.find("type");
  out.width = type != json.end() && type->is_string() ? width_of(type->get_ref<const std::string&>()) : 0;
  if (bytes == 0 || out.width == 0) refuse("is of a type that is not known");
  out.component = static_cast<glb::Component>(component);
  const auto normalized = json.find("normalized");
  out.normalized = normalized != json.end() && *normalized == true;
  out.count = whole(json, "count");
  const std::uint64_t row = bytes * out.width;
  const std::uint64_t stride = whole(view, "byteStride", row);
  constexpr std::uint64_t kMostStride = 252;
  const std::uint64_t begin = whole(view, "byteOffset", 0), length = whole(view, "byteLength");
  const std::uint64_t first = whole(json, "byteOffset", 0);
  if (stride < row || stride > std::max(row, kMostStride)) refuse("has a stride that cannot be");
  const std::uint64_t buffer = whole(view, "buffer");
  if (buffer >= buffers_.size() || begin + length > buffers_[buffer].size() ||
      (out.count > 0 && first + stride * (out.count - 1) + row > length))
    refuse("reaches beyond the file's data");
  out.stride = stride;
  out.data = reinterpret_cast<const std::byte*>(buffers_[buffer].data()) + begin + first;
  return out;
}

void GlbFile::fail(const std::string& what) const {
  throw Error(ExitCode::unreadable, fmt::format("{}: {}", path_, what));
}

}  // namespace lamina::meshes
