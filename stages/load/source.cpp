#include "stages/load/source.h"

#include <fmt/core.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <utility>

namespace lamina::load {
namespace {

constexpr ReadRules kRules{.fault = Fault::kInput,
                           .missing = "cannot be opened: No such file or directory",
                           .directory = "is a directory; name a part file (STL, OBJ or 3MF)",
                           .device = "is not a regular file; write the part to a file first"};

constexpr std::size_t kStep = std::size_t{1} << 20;

/// The size that the last four bytes of the file claim, as a hint; 0 if it is not plausible.
std::size_t claimed_size(const Source& compressed) {
  std::array<unsigned char, 4> tail{};
  if (compressed.size() < 18 || !compressed.read(compressed.size() - 4, reinterpret_cast<char*>(tail.data()), 4)) return 0;
  const std::uint64_t claim = tail[0] | tail[1] << 8 | tail[2] << 16 | std::uint64_t{tail[3]} << 24;
  return claim > compressed.size() * 20 ? 0 : static_cast<std::size_t>(claim);
}

}  // namespace

Result<Source> Source::open(const std::string& path) {
  if (path == "-") return Error{Fault::kInput, "-: parts are not read from standard input; write it to a file first"};
  Source source;
  source.path_ = path;
  source.stamp_ = file_stamp(path);
  auto file = FileReader::open(path, kRules);
  if (!file) return file.error();
  source.size_ = file->size();
  source.file_.emplace(std::move(*file));
  return source;
}

Source Source::of_memory(std::string path, std::shared_ptr<const Buffer<char>> bytes) {
  Source source;
  source.path_ = std::move(path);
  source.size_ = bytes->size();
  source.memory_ = std::move(bytes);
  return source;
}

bool Source::read(std::uint64_t offset, char* to, std::size_t count) const {
  if (offset > size_ || count > size_ - offset) return false;
  if (file_) return file_->read_at(offset, {to, count});
  if (count > 0) std::memcpy(to, memory_->data() + offset, count);
  return true;
}

std::string_view Source::head(std::span<char> space) const {
  const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(space.size(), size_));
  return read(0, space.data(), count) ? std::string_view(space.data(), count) : std::string_view();
}

Result<Source> inflate_gzip(const Source& compressed, std::uint64_t limit) {
  z_stream stream{};
  if (inflateInit2(&stream, 16 + MAX_WBITS) != Z_OK) throw std::bad_alloc();  // the only way to fail
  const std::unique_ptr<z_stream, int (*)(z_stream*)> end(&stream, inflateEnd);

  Buffer<char> input(kStep), output;
  // One byte more than claimed, so that the end of the stream is detected without growing.
  output.resize(std::max<std::size_t>(claimed_size(compressed) + 1, kStep));
  std::uint64_t read = 0;
  std::size_t written = 0;
  bool within_member = false;
  while (true) {
    if (stream.avail_in == 0) {
      const std::size_t count = static_cast<std::size_t>(std::min<std::uint64_t>(kStep, compressed.size() - read));
      if (count == 0) break;
      if (!compressed.read(read, input.data(), count)) return compressed.changed_while_read();
      read += count;
      stream.next_in = reinterpret_cast<Bytef*>(input.data());
      stream.avail_in = static_cast<uInt>(count);
    }
    if (!within_member) {
      // Bytes after a member that are not another one are padding; gzip ignores it too.
      if (written > 0 && *stream.next_in != 0x1f) break;
      if (inflateReset(&stream) != Z_OK) return Error{Fault::kInternal, "zlib cannot be started"};
      within_member = true;
    }
    if (written == output.size()) output.resize(output.size() + output.size() / 2 + kStep);
    const std::size_t capacity = std::min(output.size() - written, kStep * 64);
    stream.next_out = reinterpret_cast<Bytef*>(output.data() + written);
    stream.avail_out = static_cast<uInt>(capacity);
    const int status = inflate(&stream, Z_NO_FLUSH);
    written += capacity - stream.avail_out;
    if (status == Z_STREAM_END) {
      within_member = false;
    } else if (status != Z_OK && !(status == Z_BUF_ERROR && (stream.avail_in == 0 || stream.avail_out == 0))) {
      return compressed.error(fmt::format("gzip data is damaged at byte {} ({}); copy or compress the file again",
                                          read - stream.avail_in, stream.msg ? stream.msg : "unknown error"));
    }
    if (written > limit)
      return compressed.error(fmt::format("expands to more than the limit of {} bytes; inflate it to see what it is", limit));
    if (expansion_is_absurd(read - stream.avail_in, written))
      return compressed.error("expands more than 200-fold, as no part does; inflate it to see what it is");
  }
  if (within_member) return compressed.error("gzip data ends early: the file was cut short; copy it again");
  output.resize(written);
  return Source::of_memory(std::string(compressed.path()), std::make_shared<const Buffer<char>>(std::move(output)));
}

}  // namespace lamina::load
