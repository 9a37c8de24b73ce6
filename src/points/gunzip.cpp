#include "points/gunzip.h"

#include <fmt/format.h>
#include <zlib.h>

#include <memory>

#include "lamina/error.h"
#include "points/sniff.h"

namespace lamina {
namespace {

constexpr std::size_t kBytes = 256 << 10;
constexpr int kGzipOnly = 16 + MAX_WBITS;

class Inflater {
 public:
  explicit Inflater(const std::string& name) {
    if (inflateInit2(&stream, kGzipOnly) != Z_OK) {
      throw Error(ExitCode::budget, fmt::format("{}: no memory to unpack it", name));
    }
  }
  ~Inflater() { inflateEnd(&stream); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  z_stream stream{};
};

}  // namespace

bool is_gzip(std::string_view start) {
  return start.starts_with("\x1f\x8b");
}

InputFile unpack_gzip(const InputFile& packed, const std::string& tmp_dir) {
  const auto in = std::make_unique_for_overwrite<Bytef[]>(kBytes);
  const auto out = std::make_unique_for_overwrite<Bytef[]>(kBytes);
  Inflater inflater(packed.name);
  z_stream& stream = inflater.stream;
  std::uint64_t offset = 0;
  bool member_ended = false;
  Spool spool(packed.name, tmp_dir);
  const auto damaged = [&](std::string_view what) {
    throw Error(ExitCode::unreadable,
                fmt::format("{}: the gzip data are {} at byte {}; copy or compress the file again", packed.name, what,
                            offset - stream.avail_in));
  };
  for (;;) {
    if (stream.avail_in == 0) {
      stream.next_in = in.get();
      stream.avail_in = static_cast<uInt>(packed.read(offset, in.get(), kBytes));
      offset += stream.avail_in;
      if (stream.avail_in == 0) {
        if (!member_ended) damaged("cut short");
        break;
      }
    }
    if (member_ended) {
      if (*stream.next_in == 0) {  // padding, as tapes and some tools leave it
        --stream.avail_in;
        ++stream.next_in;
        continue;
      }
      inflateReset(&stream);
      member_ended = false;
    }
    stream.next_out = out.get();
    stream.avail_out = kBytes;
    const int status = inflate(&stream, Z_NO_FLUSH);
    if (status != Z_OK && status != Z_STREAM_END) damaged("damaged");
    const std::size_t n = kBytes - stream.avail_out;
    if (n > 0 && spool.bytes() == 0) {
      detect_format({reinterpret_cast<const char*>(out.get()), std::min(n, kSniffBytes)}, packed.name);
    }
    if (n > 0) spool.write(out.get(), n);
    member_ended = status == Z_STREAM_END;
  }
  return spool.finish();
}

}  // namespace lamina
