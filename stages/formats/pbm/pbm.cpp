#include "stages/formats/pbm/pbm.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "stages/formats/images/image_formats.h"
#include "stages/formats/row_encoder.h"
#include "stages/geometry/bits.h"

namespace lamina::formats::pbm {
namespace {

class PbmEncoder : public RowEncoder {
 private:
  Status encode_rows(RowBits image, double dpi_x, double dpi_y, Bytes& file) override {
    const std::string head = fmt::format("P4\n# lamina dpi {:.10g} {:.10g}\n{} {}\n", dpi_x, dpi_y, image.columns, image.rows);
    const std::size_t stride = row_bytes(image.columns);
    file.resize(head.size() + stride * image.rows);
    std::memcpy(file.data(), head.data(), head.size());
    const std::span<std::byte> rows = std::span(file).subspan(head.size());
    for (std::uint32_t r = 0; r < image.rows; ++r) image.put(r, rows.subspan(stride * r, stride));
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
  std::uint64_t brightest = 0;       // of a PGM
  bool grey = false, plain = false;  // plain: numbers in ASCII
  double dpi_x = 0, dpi_y = 0;
  std::size_t bytes = 0;  // of the header; pixels follow
};

/// The header of a P1, P2, P4 or P5 file: two or three numbers amid white space and comments, then one white space.
std::optional<PbmHeader> parse_head(std::string_view text) {
  if (text.size() < 2 || text[0] != 'P' || std::string_view("1245").find(text[1]) == std::string_view::npos)
    return std::nullopt;
  const bool grey = text[1] == '2' || text[1] == '5';
  PbmHeader head;
  head.grey = grey;
  head.plain = text[1] < '3';
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

/// Numbers of an ASCII file, read in blocks.
class PlainNumbers {
 public:
  PlainNumbers(const FileReader& file, std::uint64_t at) : file_(file), at_(at) {}

  /// The next number; of PBM each digit is one. returns  -1: the file ends; -2: not a number up to 65535
  int next(bool bits) {
    int c = get();
    while (c >= 0 && (is_space(static_cast<char>(c)) || c == '#')) {
      if (c == '#')
        while (c >= 0 && c != '\n' && c != '\r') c = get();
      else
        c = get();
    }
    if (c < 0) return -1;
    if (c < '0' || c > '9' || (bits && c > '1')) return -2;
    int value = c - '0';
    while (!bits && (c = get()) >= '0' && c <= '9') {
      value = value * 10 + (c - '0');
      if (value > UINT16_MAX) return -2;
    }
    return bits || c < 0 || is_space(static_cast<char>(c)) ? value : -2;
  }

  /// Rows as a binary file has them. returns  false if a number is missing, or is none
  bool read_rows(const PbmHeader& head, std::uint32_t rows, std::size_t stride, std::span<std::byte> to) {
    std::ranges::fill(to, std::byte{});
    for (std::size_t r = 0; r < rows; ++r) {
      const std::span<std::byte> row = to.subspan(stride * r, stride);
      for (std::size_t c = 0; c < head.columns; ++c) {
        const int value = next(!head.grey);
        if (value < 0) return false;
        if (!head.grey) {
          row[c / 8] |= static_cast<std::byte>(value << (7 - c % 8));
        } else if (head.brightest < 256) {
          row[c] = static_cast<std::byte>(std::min(value, 255));
          if (value > 255) return false;
        } else {
          row[2 * c] = static_cast<std::byte>(value >> 8);
          row[2 * c + 1] = static_cast<std::byte>(value);
        }
      }
    }
    return true;
  }

 private:
  int get() {
    if (next_ == end_) {
      const std::uint64_t left = file_.size() - std::min(at_, file_.size());
      end_ = static_cast<std::size_t>(std::min<std::uint64_t>(left, buffer_.size()));
      next_ = 0;
      if (end_ == 0 || !read_bytes_at(file_, at_, std::span(buffer_).first(end_))) return end_ = 0, -1;
      at_ += end_;
    }
    return std::to_integer<int>(buffer_[next_++]);
  }

  const FileReader& file_;
  std::uint64_t at_;
  Buffer<std::byte> buffer_ = Buffer<std::byte>(64 * 1024);
  std::size_t next_ = 0, end_ = 0;
};

/// Prepares values up to head.brightest for bits_of_grey() of one byte, or, `to_levels`, for a sink: unscaled, low byte first.
/// returns  false if a value is above it
bool scale_row(std::span<std::byte> row, const PbmHeader& head, const Colours& scale, bool to_levels) {
  const auto columns = static_cast<std::uint32_t>(head.columns), maximum = static_cast<std::uint32_t>(head.brightest);
  if (maximum == 255) return true;
  if (maximum < 256 && !to_levels) return widen_row(row, columns, 8, scale);
  if (maximum < 256) return std::ranges::all_of(row, [&](std::byte v) { return std::to_integer<unsigned>(v) <= maximum; });
  for (std::size_t c = 0; c < columns; ++c) {
    const unsigned value = std::to_integer<unsigned>(row[2 * c]) << 8 | std::to_integer<unsigned>(row[2 * c + 1]);
    if (value > maximum) return false;
    if (to_levels) {
      std::swap(row[2 * c], row[2 * c + 1]);
    } else {
      row[c] = static_cast<std::byte>(value * 256 / (maximum + 1));
    }
  }
  return true;
}

/// Why the file is not as long as its header says, or nothing. lenient  a line may end after the last pixel
std::string wrong_size(const FileReader& file, const PbmHeader& head, std::uint64_t stride, bool lenient) {
  const std::uint64_t bytes = file.size(), pixels = head.columns * head.rows;
  const std::uint64_t expected = head.bytes + (head.plain ? pixels * (head.grey ? 2 : 1) - head.grey : stride * head.rows);
  const std::uint64_t more = bytes - std::min(bytes, expected);
  std::array<std::byte, 2> end{};
  const bool is_line_end =
      lenient && more <= end.size() && read_bytes_at(file, expected, std::span(end).first(more)) &&
      std::ranges::all_of(std::span(end).first(more), [](std::byte c) { return c == std::byte{'\n'} || c == std::byte{'\r'}; });
  if (bytes >= expected && (more == 0 || is_line_end || head.plain)) return {};
  return fmt::format("{} bytes where {} x {} pixels take {}{}", bytes, head.columns, head.rows, expected,
                     head.plain ? " or more" : "");
}

}  // namespace

unsigned pgm_bits(const FileReader& file) {
  Buffer<std::byte> buffer(std::min<std::uint64_t>(file.size(), kMaxHeadBytes));
  if (!read_bytes_at(file, 0, buffer)) return 8;
  const auto head = parse_head({reinterpret_cast<const char*>(buffer.data()), buffer.size()});
  return head && head->brightest > 255 ? 16 : 8;
}

Result<Image> read_pbm(const FileReader& file, int threshold, LevelSink* sink, Keep keep) {
  const auto failure = [&](std::string_view why) {
    return Error{Fault::kVerification, fmt::format("{}: not a whole PBM or PGM: {}; plan the layer again", file.path(), why)};
  };
  Buffer<std::byte> buffer(std::min<std::uint64_t>(file.size(), kMaxHeadBytes));
  if (!read_bytes_at(file, 0, buffer)) return failure("cannot read");
  const auto head = parse_head({reinterpret_cast<const char*>(buffer.data()), buffer.size()});
  if (!head) return failure("its header is not one");
  if (head->columns == 0 || head->rows == 0 || head->columns > kMaxPixelsASide || head->rows > kMaxPixelsASide) {
    return failure(fmt::format("{} x {} pixels", head->columns, head->rows));
  }
  const auto columns = static_cast<std::uint32_t>(head->columns), rows = static_cast<std::uint32_t>(head->rows);
  if (head->grey && (head->brightest < 1 || head->brightest > UINT16_MAX))
    return failure(fmt::format("its grey ends at {}, not between 1 and 65535", head->brightest));
  const unsigned value_bytes = head->brightest > 255 ? 2 : 1;
  const std::size_t stride = head->grey ? std::size_t{columns} * value_bytes : row_bytes(columns);
  if (const std::string wrong = wrong_size(file, *head, stride, threshold > 0); !wrong.empty()) return failure(wrong);

  const bool to_sink = sink != nullptr && head->grey;
  if (to_sink) sink->levels.start(columns);
  RunsBuilder builder(columns, rows, keep);
  Colours scale;
  if (head->grey && head->brightest < 255) scale = Colours::of_grey(static_cast<unsigned>(head->brightest));
  std::optional<PlainNumbers> numbers;
  if (head->plain) numbers.emplace(file, head->bytes);
  const std::uint32_t rows_at_once = static_cast<std::uint32_t>(std::max<std::size_t>(1, 256 * 1024 / stride));
  buffer.resize(stride * std::min(rows_at_once, rows));
  for (std::uint32_t first = 0; first < rows; first += rows_at_once) {
    const std::uint32_t count = std::min(rows_at_once, rows - first);
    const std::span<std::byte> strip = std::span(buffer).first(stride * count);
    if (numbers && !numbers->read_rows(*head, count, stride, strip))
      return failure(fmt::format("rows {} to {}: a pixel is missing or not a number", first, first + count - 1));
    if (!numbers && !read_bytes_at(file, head->bytes + std::uint64_t{stride} * first, strip)) return failure("cannot read");
    for (std::uint32_t r = 0; r < count; ++r) {
      const std::span<std::byte> row = strip.subspan(stride * r, stride);
      if (head->grey && !scale_row(row, *head, scale, to_sink))
        return failure(fmt::format("row {}: a value is above its maximum of {}", first + r, head->brightest));
      if (to_sink) {
        const auto maximum = static_cast<unsigned>(head->brightest);
        if (!sink->add_row(row, columns, 8 * value_bytes, false, maximum)) return failure("too many runs");
        continue;
      }
      if (head->grey) bits_of_grey(row, columns, 1, false, threshold);
      if (!builder.add_row(row.first(row_bytes(columns)), false)) return failure("too many runs");
    }
  }
  if (numbers && numbers->next(true) != -1) return failure("more than its pixels");
  return image_of(builder, columns, head->dpi_x, head->dpi_y);
}

}  // namespace lamina::formats
