// E57 files made by hand, to the letter of the standard: pages, packets of any size, packed bits.
#pragma once
#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace lamina::test {

/// One field: its line in the prototype, its values as bits, and how many bits each has.
struct E57TestField {
  std::string line;
  unsigned bits = 0;
  std::vector<std::uint64_t> values;
};

inline E57TestField e57_double(const std::string& name, const std::vector<double>& values) {
  E57TestField field{"<" + name + " type=\"Float\"/>", 64, {}};
  for (const double v : values) field.values.push_back(std::bit_cast<std::uint64_t>(v));
  return field;
}

inline E57TestField e57_float(const std::string& name, const std::vector<float>& values) {
  E57TestField field{"<" + name + " type=\"Float\" precision=\"single\"/>", 32, {}};
  for (const float v : values) field.values.push_back(std::bit_cast<std::uint32_t>(v));
  return field;
}

/// `more`: further attributes, as type and scale.
inline E57TestField e57_integer(const std::string& name, std::int64_t low, std::int64_t high,
                                const std::vector<std::int64_t>& values, const std::string& more = "type=\"Integer\"") {
  E57TestField field{
      "<" + name + " " + more + " minimum=\"" + std::to_string(low) + "\" maximum=\"" + std::to_string(high) + "\"/>",
      static_cast<unsigned>(std::bit_width(static_cast<std::uint64_t>(high) - static_cast<std::uint64_t>(low))),
      {}};
  for (const std::int64_t v : values)
    field.values.push_back(static_cast<std::uint64_t>(v) - static_cast<std::uint64_t>(low));
  return field;
}

struct E57TestScan {
  std::string xml;  ///< pose, limits
  std::vector<E57TestField> fields;
  std::size_t packet = 1000;  ///< bytes of every stream in a packet, at most
};

class E57TestFile {
 public:
  void add(const E57TestScan& scan) {
    const std::size_t section = payload_.size();
    payload_.resize(section + 32);
    payload_[section] = 1;
    std::vector<std::string> streams;
    for (const E57TestField& field : scan.fields) streams.push_back(packed(field));
    for (bool more = true; more;) {
      more = false;
      std::string packet(6 + 2 * streams.size(), '\0');
      packet[0] = 1;
      number(packet, 4, 2, streams.size());
      for (std::size_t k = 0; k < streams.size(); ++k) {
        // Streams are out of step with each other.
        const std::size_t n = std::min(streams[k].size(), scan.packet + 7 * k);
        number(packet, 6 + 2 * k, 2, n);
        packet += streams[k].substr(0, n);
        streams[k].erase(0, n);
        more = more || !streams[k].empty();
      }
      packet.resize((packet.size() + 3) / 4 * 4);
      number(packet, 2, 2, packet.size() - 1);
      payload_ += packet + std::string("\2\0\3\0", 4);  // and an empty one
    }
    number(payload_, section + 8, 8, payload_.size() - section);
    number(payload_, section + 16, 8, in_file(section + 32));
    xml_ += "<vectorChild type=\"Structure\">" + scan.xml + "<points type=\"CompressedVector\" fileOffset=\"" +
            std::to_string(in_file(section)) + "\" recordCount=\"" +
            std::to_string(scan.fields.empty() ? 0 : scan.fields[0].values.size()) +
            "\"><prototype type=\"Structure\">";
    for (const E57TestField& field : scan.fields) xml_ += field.line + "\n";
    xml_ += "</prototype></points></vectorChild>\n";
  }

  /// `more`: what else stands at the top of the XML section.
  [[nodiscard]] std::string bytes(const std::string& more = "") const {
    const std::string xml = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<e57Root type=\"Structure\">" + more +
                            "<data3D type=\"Vector\">" + xml_ + "</data3D></e57Root>\n";
    std::string payload = payload_ + xml;
    payload.resize((payload.size() + 1019) / 1020 * 1020);
    payload.replace(0, 8, "ASTM-E57");
    number(payload, 8, 4, 1);
    number(payload, 16, 8, payload.size() / 1020 * 1024);
    number(payload, 24, 8, in_file(payload_.size()));
    number(payload, 32, 8, xml.size());
    number(payload, 40, 8, 1024);
    std::string file;
    for (std::size_t at = 0; at < payload.size(); at += 1020) {
      const std::string page = payload.substr(at, 1020);
      const std::uint32_t crc = checksum(page);
      file += page;
      for (const unsigned shift : {24U, 16U, 8U, 0U}) file += static_cast<char>(crc >> shift);
    }
    return file;
  }

 private:
  static void number(std::string& bytes, std::size_t at, std::size_t size, std::uint64_t value) {
    for (std::size_t k = 0; k < size; ++k) bytes[at + k] = static_cast<char>(value >> (8 * k));
  }
  static std::size_t in_file(std::size_t payload) { return payload / 1020 * 1024 + payload % 1020; }

  static std::string packed(const E57TestField& field) {
    std::string bytes((field.values.size() * field.bits + 7) / 8, '\0');
    std::size_t at = 0;
    for (const std::uint64_t value : field.values) {
      for (unsigned k = 0; k < field.bits; ++k, ++at) {
        if (((value >> k) & 1U) != 0) bytes[at / 8] = static_cast<char>(bytes[at / 8] | (1 << (at % 8)));
      }
    }
    return bytes;
  }

  /// CRC-32C bit by bit.
  static std::uint32_t checksum(const std::string& bytes) {
    std::uint32_t crc = 0xFFFFFFFF;
    for (const char c : bytes) {
      crc ^= static_cast<unsigned char>(c);
      for (int k = 0; k < 8; ++k) crc = (crc >> 1U) ^ ((crc & 1U) != 0 ? 0x82F63B78U : 0U);
    }
    return ~crc;
  }

  std::string payload_ = std::string(48, '\0'), xml_;
};

}  // namespace lamina::test
