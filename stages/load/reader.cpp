#include "stages/load/reader.h"

#include <algorithm>
#include <string_view>

#include "stages/load/foreign/foreign.h"
#include "stages/load/text.h"

namespace lamina::load {
namespace {

constexpr std::size_t kHead = 4096;

bool ends_with(std::string_view path, std::string_view lower_case) {
  return path.size() >= lower_case.size() && is_word(path.substr(path.size() - lower_case.size()), lower_case);
}

/// Binary STL has zero bytes in its first facets; text, in whatever encoding, has none (but for padding at its end),
/// nor other control characters.
bool is_text(std::string_view head) {
  head = head.substr(0, head.find_last_not_of('\0') + 1);
  return std::none_of(head.begin(), head.end(),
                      [](char c) { return c == '\0' || (c > 0 && c < 32 && !is_space(c)) || c == 127; });
}

/// First words of lines decide between the text formats.
bool has_line_with(std::string_view head, std::initializer_list<std::string_view> words) {
  std::size_t at = 0;
  while (at < head.size()) {
    while (at < head.size() && is_space(head[at])) ++at;
    const std::size_t begin = at;
    while (at < head.size() && !is_space(head[at])) ++at;
    for (const std::string_view word : words)
      if (is_word(head.substr(begin, at - begin), word)) return true;
    while (at < head.size() && !is_line_end(head[at])) ++at;
  }
  return false;
}

/// The size that a binary STL file's own count asks for. In text, the count's bytes are characters and ask for
/// more than 7 GB, so the test decides whatever the header says.
bool has_binary_stl_size(const Source& source, std::string_view head) {
  if (head.size() < 84) return false;
  std::uint64_t count = 0;
  for (std::size_t i = 4; i-- > 0;) count = count << 8 | static_cast<unsigned char>(head[80 + i]);
  return source.size() == 84 + 50 * count;
}

}  // namespace

bool is_part_name(std::string_view path) {
  std::string_view name = path.substr(path.rfind('/') + 1);
  while (ends_with(name, ".gz")) name.remove_suffix(3);
  return name.size() > 4 && (ends_with(name, ".stl") || ends_with(name, ".obj") || ends_with(name, ".3mf"));
}

std::uint64_t part_bytes(std::string_view path, std::uint64_t file_bytes) {
  if (ends_with(path, ".stl") || ends_with(path, ".obj")) return 4 * file_bytes;
  if (ends_with(path, ".3mf")) return 40 * file_bytes;
  return (ends_with(path, ".gz") ? 16 : 1) * file_bytes;
}

Result<Format> detect(const Source& source) {
  if (source.size() == 0) return source.error("is empty; export the part again");
  std::string bytes = source.head(kHead);
  if (bytes.empty()) return source.changed_while_read();
  std::string_view head = bytes;
  if (head.substr(0, 4) == "PK\x03\x04" || head.substr(0, 4) == std::string_view("PK\x05\x06", 4)) return Format::k3mf;
  if (head.substr(0, 2) == "\x1f\x8b") return Format::kGzip;
  if (has_binary_stl_size(source, head)) return Format::kBinaryStl;
  if (std::string foreign = foreign_format(head); !foreign.empty()) return source.error(foreign);
  if (head.substr(0, 3) == "\xef\xbb\xbf") head.remove_prefix(3);
  std::string_view name = source.path();
  if (ends_with(name, ".gz")) name.remove_suffix(3);
  if (is_text(head)) {
    if (has_line_with(head, {"solid", "facet", "endsolid"}) && !ends_with(name, ".obj")) return Format::kAsciiStl;
    if (has_line_with(head, {"v", "f"})) return Format::kObj;
    if (ends_with(name, ".obj") && !is_machine_program(head)) return Format::kObj;
    if (has_line_with(head, {"#", "o", "g", "mtllib", "vn", "vt"}) && !ends_with(name, ".stl")) return Format::kObj;
    if (is_machine_program(head)) return source.error("is G-code, the moves of a machine; name the part that it was made of");
    return source.error("is text, but neither STL nor OBJ; export the part again");
  }
  if (ends_with(name, ".3mf")) return source.error("is not a zip file, as 3MF is; copy or export it again");
  if (ends_with(name, ".obj")) return source.error("is not text, as OBJ is; copy or export it again");
  if (ends_with(name, ".stl")) return Format::kBinaryStl;
  return source.error("is neither STL, OBJ nor 3MF; export the part as one of these");
}

}  // namespace lamina::load
