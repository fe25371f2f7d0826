#include "stages/formats/pbm/pbm.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>

#include "stages/formats/images/image_formats.h"
#include "stages/geometry/bits.h"

namespace lamina::formats::pbm {
namespace {

class PbmEncoder : public ImageEncoder {
 public:
  Status encode(const RunsView& runs, double dpi_x, double dpi_y, Bytes& file) override {
    const std::string head = fmt::format("P4\n# lamina dpi {:.10g} {:.10g}\n{} {}\n", dpi_x, dpi_y, runs.columns, runs.rows());
    const std::size_t stride = row_bytes(runs.columns);
    file.resize(head.size() + stride * runs.rows());
    std::memcpy(file.data(), head.data(), head.size());
    const std::span<std::byte> rows = std::span(file).subspan(head.size());
    for (std::uint32_t r = 0; r < runs.rows(); ++r) expand_row(runs.row(r), rows.subspan(stride * r, stride));
    return {};
  }
};

}  // namespace

std::unique_ptr<ImageEncoder> make_encoder() { return std::make_unique<PbmEncoder>(); }

}  // namespace lamina::formats::pbm

namespace lamina::formats {
namespace {

// More than any header of ours, and than any sensible comment of others.
constexpr std::size_t kMaxHeadBytes = 4096;

bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

struct PbmHeader {
  std::uint64_t columns = 0, rows = 0;
  std::uint64_t brightest = 0;  // of a PGM
  bool grey = false;
  double dpi_x = 0, dpi_y = 0;
  std::size_t bytes = 0;  // of the header; pixels follow
};

/// The header of a P4 or P5 file: two or three numbers amid white space and comments, then one white space.
std::optional<PbmHeader> parse_head(std::string_view text) {
  const bool grey = text.substr(0, 2) == "P5";
  if (!grey && text.substr(0, 2) != "P4") return std::nullopt;
  PbmHeader head;
  head.grey = grey;
  std::uint64_t* const numbers[] = {&head.columns, &head.rows, &head.brightest};
  std::size_t at = 2;
  for (std::uint64_t* number : std::span(numbers).first(grey ? 3 : 2)) {
    const std::size_t gap = at;
    while (at < text.size() && (is_space(text[at]) || text[at] == '#')) {
      if (text[at] != '#') {
        ++at;
        continue;
      }
      const std::size_t end = text.find_first_of("\r\n", at);
      if (end == std::string_view::npos) return std::nullopt;
      const std::string comment(text.substr(at, end - at));
      double x = 0, y = 0;
      if (std::sscanf(comment.c_str(), "# lamina dpi %lf %lf", &x, &y) == 2 && x > 0 && y > 0) {
        head.dpi_x = x;
        head.dpi_y = y;
      }
      at = end;
    }
    const std::size_t digits = at;
    if (at == gap) return std::nullopt;
    for (; at < text.size() && text[at] >= '0' && text[at] <= '9' && at - digits < 10; ++at) {
      *number = *number * 10 + static_cast<std::uint64_t>(text[at] - '0');
    }
    if (at == digits) return std::nullopt;
  }
  if (at >= text.size() || !is_space(text[at])) return std::nullopt;
  head.bytes = at + 1;
  return head;
}

}  // namespace

Result<Image> read_pbm(const FileReader& file, int threshold, LevelSink* sink) {
  const auto failure = [&](std::string_view why) {
    return Error{Fault::kVerification,
                 fmt::format("{}: not a whole PBM (P4) or PGM: {}; plan the layer again", file.path(), why)};
  };
  const std::uint64_t bytes = file.size();
  Buffer<std::byte> buffer(std::min<std::uint64_t>(bytes, kMaxHeadBytes));
  if (!read_bytes_at(file, 0, buffer)) return failure("cannot read");
  const auto head = parse_head({reinterpret_cast<const char*>(buffer.data()), buffer.size()});
  if (!head) return failure("its header is not one");
  if (head->columns == 0 || head->rows == 0 || head->columns > kMaxPixelsASide || head->rows > kMaxPixelsASide) {
    return failure(fmt::format("{} x {} pixels", head->columns, head->rows));
  }
  const auto columns = static_cast<std::uint32_t>(head->columns), rows = static_cast<std::uint32_t>(head->rows);
  if (head->grey && head->brightest != 255) return failure(fmt::format("its grey ends at {}, not at 255", head->brightest));
  const std::size_t stride = head->grey ? columns : row_bytes(columns);
  const std::uint64_t expected = head->bytes + std::uint64_t{stride} * rows;
  if (bytes != expected) return failure(fmt::format("{} bytes where {} x {} pixels take {}", bytes, columns, rows, expected));

  const bool to_sink = sink != nullptr && head->grey;
  if (to_sink) sink->levels.start(columns);
  RunsBuilder builder(columns);
  const std::uint32_t rows_at_once = static_cast<std::uint32_t>(std::max<std::size_t>(1, 256 * 1024 / stride));
  buffer.resize(stride * std::min(rows_at_once, rows));
  for (std::uint32_t first = 0; first < rows; first += rows_at_once) {
    const std::uint32_t count = std::min(rows_at_once, rows - first);
    const std::span<std::byte> strip = std::span(buffer).first(stride * count);
    if (!read_bytes_at(file, head->bytes + std::uint64_t{stride} * first, strip)) return failure("cannot read");
    for (std::uint32_t r = 0; r < count; ++r) {
      const std::span<std::byte> row = strip.subspan(stride * r, stride);
      if (to_sink) {
        if (!sink->add_row(row, columns, 8, false)) return failure("too many runs");
        continue;
      }
      if (head->grey) bits_of_grey(row, columns, 1, false, threshold);
      if (!builder.add_row(row.first(row_bytes(columns)), false)) return failure("too many runs");
    }
  }
  return Image{builder.finish(), head->dpi_x, head->dpi_y};
}

}  // namespace lamina::formats
