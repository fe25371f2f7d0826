#include "pipeline/watch/completeness.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "stages/support/io/file_reader.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

constexpr std::uint64_t kStlHead = 84, kStlFacet = 50;  // bytes; source: stages/load/stl_binary.h
constexpr std::uint64_t kZipEnd = 22, kMaxZipComment = 65535, kZip64Locator = 20;
constexpr std::uint64_t kMaxGzipRatio = 200, kSmallExpansion = 64 << 20;  // as the loader, which refuses such files

FileEnd missing(std::string what) { return {FileEnd::Content::kMissing, std::move(what), false}; }
FileEnd unread(std::string why) { return {FileEnd::Content::kMissing, std::move(why), true}; }
FileEnd unstated() { return {FileEnd::Content::kUnstated, {}, false}; }
FileEnd stated() { return {FileEnd::Content::kStated, {}, false}; }

/// A number of little-endian bytes.
std::uint64_t number_at(std::string_view bytes, std::size_t at, std::size_t count) {
  std::uint64_t number = 0;
  for (std::size_t i = 0; i < count; ++i) number |= std::uint64_t{static_cast<unsigned char>(bytes[at + i])} << (8 * i);
  return number;
}

/// The last bytes of a file, at most `count`; none if they cannot be read.
std::string tail_of(const FileReader& file, std::uint64_t count) {
  std::string tail(static_cast<std::size_t>(std::min(count, file.size())), '\0');
  return file.read_at(file.size() - tail.size(), tail) ? tail : std::string();
}

/// source  APPNOTE.TXT 6.3.10, 4.3.6 and 4.3.16: the end record has the position of the directory in front of it
FileEnd zip_end(const FileReader& file) {
  const std::string tail = tail_of(file, kZipEnd + kMaxZipComment);
  if (tail.empty()) return unread("cannot be read to its end");
  const std::string_view text = tail;
  for (std::size_t at = text.rfind("PK\x05\x06"); at != std::string_view::npos;
       at = at == 0 ? std::string_view::npos : text.rfind("PK\x05\x06", at - 1)) {
    if (text.size() - at < kZipEnd || text.size() - at != kZipEnd + number_at(text, at + 20, 2)) continue;
    const std::uint64_t end = file.size() - text.size() + at, bytes = number_at(text, at + 12, 4),
                        begin = number_at(text, at + 16, 4);
    if (begin + bytes == end) return stated();
    if (at >= kZip64Locator && text.substr(at - kZip64Locator, 4) == "PK\x06\x07") return stated();
    return unstated();
  }
  return missing("no ZIP end record");
}

/// A file of one member states its end; more members could follow those of a file of several.
FileEnd gzip_end(const FileReader& file, const std::atomic<bool>& stop) {
  z_stream stream{};
  if (inflateInit2(&stream, 16 + MAX_WBITS) != Z_OK) return unread("not enough memory to inflate it");
  const std::unique_ptr<z_stream, int (*)(z_stream*)> ends(&stream, inflateEnd);
  std::string in(256 << 10, '\0'), out(256 << 10, '\0');
  int members = 0;
  std::uint64_t expanded = 0;
  bool inside = true;
  // The last 8 bytes of a member are read after all of its output.
  for (std::uint64_t read = 0; read < file.size() || stream.avail_in > 0;) {
    if (stop) return unread("not read");
    if (stream.avail_in == 0) {
      in.resize(static_cast<std::size_t>(std::min<std::uint64_t>(in.size(), file.size() - read)));
      if (!file.read_at(read, in)) return unread("cannot be read to its end");
      read += in.size();
      stream.next_in = reinterpret_cast<Bytef*>(in.data());
      stream.avail_in = static_cast<uInt>(in.size());
    }
    if (!inside && *stream.next_in != 0x1f) return unstated();  // padding, which gzip ignores
    if (!inside && inflateReset(&stream) != Z_OK) return unstated();
    inside = true;
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    const int result = inflate(&stream, Z_NO_FLUSH);
    expanded += out.size() - stream.avail_out;
    if (result == Z_STREAM_END) {
      ++members;
      inside = false;
    } else if (result != Z_OK && result != Z_BUF_ERROR) {
      return unstated();  // damaged: the loader says where
    }
    if (expanded > kSmallExpansion && expanded / kMaxGzipRatio > read) return unstated();
  }
  if (inside) return missing("the gzip stream ends early");
  return members == 1 ? stated() : unstated();
}

FileEnd stl_end(const FileReader& file, std::string_view head) {
  if (file.size() < kStlHead) return missing(fmt::format("{} of at least {} bytes", file.size(), kStlHead));
  const std::string start = lower_case(head);
  const bool has_facet = start.find("facet") != std::string::npos && start.find("vertex") != std::string::npos;
  const bool is_text = has_facet || head.find('\0') == std::string_view::npos;
  if (!is_text) {
    const std::uint64_t bytes = kStlHead + kStlFacet * number_at(head, kStlHead - 4, 4);
    return file.size() < bytes ? missing(fmt::format("{} of {} bytes", file.size(), bytes)) : unstated();
  }
  if (start.find("solid") == std::string::npos && start.find("facet") == std::string::npos) return unstated();  // no STL
  const std::string tail = lower_case(tail_of(file, 4096));
  if (tail.empty()) return unread("cannot be read to its end");
  return tail.find("endsolid") == std::string::npos ? missing("no endsolid") : unstated();
}

}  // namespace

FileEnd end_of_file(const std::string& path, const std::atomic<bool>& stop) {
  auto file = FileReader::open(path, {.fault = Fault::kInput});
  if (!file) return unread(file.error().message);
  if (file->size() == 0) return missing("it is empty");
  std::array<char, 512> space;
  const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(space.size(), file->size()));
  if (!file->read_at(0, {space.data(), count})) return unread("cannot be read to its end");
  const std::string_view head(space.data(), count);
  if (head.starts_with("PK\x03\x04") || head.starts_with("PK\x05\x06")) return zip_end(*file);
  if (head.starts_with("\x1f\x8b")) return gzip_end(*file, stop);
  if (count >= kStlHead && file->size() == kStlHead + kStlFacet * number_at(head, kStlHead - 4, 4)) return stated();
  std::string name = lower_case(path);
  if (name.ends_with(".gz") && count < 2) return missing("the gzip stream ends early");
  while (name.ends_with(".gz")) name.resize(name.size() - 3);
  if (name.ends_with(".stl")) return stl_end(*file, head);
  return name.ends_with(".3mf") && count < 4 ? missing("no ZIP end record") : unstated();
}

}  // namespace lamina::pipeline
