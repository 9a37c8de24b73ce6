#include "meshes/glb_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "base/little_endian.h"
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
    } else if (kind == glb::kDataChunk && data_.empty()) {
      data_ = std::move(chunk);
    }
  }
  if (!any) fail("has no JSON chunk");
  if (bytes_ != length || file.sgetc() != FileBuffer::traits_type::eof())
    fail("is not as long as its header says: the file is damaged");
  file.require_sound();
  require_own_data();
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

void GlbFile::require_own_data() const {
  for (const nlohmann::json& name : json_.value("extensionsRequired", nlohmann::json::array())) {
    const std::string extension = name.is_string() ? name.get<std::string>() : name.dump();
    if (!is_harmless(extension))
      fail(fmt::format("needs the extension {}, which is not read; write it without compression", extension));
  }
  const nlohmann::json buffers = json_.value("buffers", nlohmann::json::array());
  if (!buffers.is_array() || buffers.size() > 1 || (buffers.size() == 1 && buffers[0].contains("uri")))
    fail("keeps data in other files; only GLB files that hold all of it are read");
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
  if (begin + length > data_.size() || whole(view, "buffer") != 0 ||
      (out.count > 0 && first + stride * (out.count - 1) + row > length))
    refuse("reaches beyond the file's data");
  out.stride = stride;
  out.data = reinterpret_cast<const std::byte*>(data_.data()) + begin + first;
  return out;
}

void GlbFile::fail(const std::string& what) const {
  throw Error(ExitCode::unreadable, fmt::format("{}: {}", path_, what));
}

}  // namespace lamina::meshes
