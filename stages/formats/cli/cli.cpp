// stages/formats/cli/cli.cpp: Common Layer Interface, text and binary; see README.md for every field.
#include "stages/formats/cli/cli.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "stages/support/text/decimal.h"

namespace lamina::formats {
namespace {

enum Direction : std::uint32_t { kInternal = 0, kExternal = 1, kOpen = 2 };

/// Labels may hold neither what separates fields nor what begins a command.
std::string label_of(std::string_view name) {
  std::string out;
  for (const char c : name) out += c == ',' || c == '/' || c == '$' || static_cast<unsigned char>(c) < 0x20 ? '_' : c;
  return out;
}

/// Hatches (single straight lines of a raster) are separated from polylines.
bool is_hatch(const ToolpathsView& paths, std::uint32_t interval) { return paths.kind[interval] == PathKind::kRaster; }

// Text; commands of 32 bits with floats; commands of 16 bits with whole units.
enum class CliForm { kText, kLong, kShort };

struct CommandCodes {
  std::uint16_t layer, polyline, hatches;
};
constexpr CommandCodes kLongCodes{127, 130, 132}, kShortCodes{128, 129, 131};
constexpr std::int64_t kMaxShort = 65535;

/// nm of a unit: of 1, 2 and 5 times a power of ten, in which heights of layers come out even, the least of which 16 bits
/// reach every coordinate.
std::int64_t short_unit(const SliceHead& head) {
  const std::int64_t maximum = std::max<std::int64_t>({head.bounds.hi.x, head.bounds.hi.y, head.bounds.hi.z, head.top, 1});
  for (std::int64_t decade = 1;; decade *= 10) {
    for (const std::int64_t unit : {decade, 2 * decade, 5 * decade}) {
      if (ceil_div(maximum, unit) <= kMaxShort) return unit;
    }
  }
}
std::int64_t in_units(std::int64_t nm, std::int64_t unit) { return nm < 0 ? -1 : (nm + unit / 2) / unit; }

class CliEncoder : public SliceEncoder {
 public:
  CliEncoder(CliForm form, bool empty_first_layer) : form_(form), empty_first_(empty_first_layer) {}

  Status check(const SliceHead& head, const SliceLayer& layer) const override;

  // The number of units has six decimals in every form, which costs nothing: a reader in the field cuts its line two
  // characters short.
  void head(const SliceHead& head, Buffer<char>& out) const override {
    const std::int64_t unit = form_ == CliForm::kShort ? short_unit(head) : kNmPerMm;
    append(out, fmt::format("$$HEADERSTART\n$${}\n$$UNITS/{:.6f}\n$$VERSION/200\n", text() ? "ASCII" : "BINARY", mm(unit)));
    for (std::size_t b = 0; b < head.parts.size(); ++b) {
      append(out, fmt::format("$$LABEL/{},{}\n", b + 1, label_of(head.parts[b])));
    }
    append(out, "$$DIMENSION/");
    const Box& box = head.bounds;
    for (const Nm v : {box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z}) {
      append_mm(out, v);
      out.push_back(',');
    }
    out.back() = '\n';
    append(out, fmt::format("$$LAYERS/{}\n$$HEADEREND", head.layers + (empty_first_ ? 1 : 0)));
    if (text()) append(out, "\n$$GEOMETRYSTART\n");
    if (empty_first_) File{form_, unit, out}.begin_layer(head.first_bottom);
  }

  void layer(const SliceHead& head, const SliceLayer& layer, Buffer<char>& out) const override {
    File file{form_, form_ == CliForm::kShort ? short_unit(head) : kNmPerMm, out};
    file.begin_layer(std::int64_t{layer.layer.bottom} + layer.layer.thickness);
    for (std::size_t b = 0; b + 1 < layer.body.size(); ++b) {
      const auto id = static_cast<std::uint32_t>(b + 1);
      for (const Direction wanted : {kExternal, kInternal}) {
        for (std::uint32_t c = layer.body[b]; c < layer.body[b + 1]; ++c) {
          const Direction direction = doubled_area(layer.contours[c]) > 0 ? kExternal : kInternal;
          if (direction == wanted) file.polyline(id, direction, layer.contours[c], true);
        }
      }
      if (layer.path_body.empty()) continue;
      for (std::uint32_t p = layer.path_body[b]; p < layer.path_body[b + 1]; ++p) file.path(id, layer.paths, p);
    }
  }

  void tail(const SliceHead&, Buffer<char>& out) const override {
    if (text()) append(out, "$$GEOMETRYEND\n");
  }

 private:
  bool text() const { return form_ == CliForm::kText; }

  /// The commands of a file.
  struct File {
    CliForm form;
    std::int64_t unit;  // nm
    Buffer<char>& out;

    template <class Integer>
    void put_little_endian(Integer value) {
      for (std::size_t i = 0; i < sizeof value; ++i) out.push_back(static_cast<char>(value >> (8 * i) & 0xFF));
    }
    void put_number(std::uint32_t value) {
      if (form == CliForm::kShort) return put_little_endian(static_cast<std::uint16_t>(value));
      put_little_endian(value);
    }
    void put_length(std::int64_t nm) {
      if (form == CliForm::kShort) return put_little_endian(static_cast<std::uint16_t>(in_units(nm, unit)));
      put_little_endian(std::bit_cast<std::uint32_t>(static_cast<float>(mm(nm))));
    }
    const CommandCodes& codes() const { return form == CliForm::kShort ? kShortCodes : kLongCodes; }

    void begin_layer(std::int64_t top) {
      if (form != CliForm::kText) {
        put_little_endian(codes().layer);
        return put_length(top);
      }
      append(out, "$$LAYER/");
      append_mm(out, top);
      out.push_back('\n');
    }

    void points(std::span<const Point2> points) {
      if (form != CliForm::kText) {
        for (const Point2 p : points) {
          put_length(p.x);
          put_length(p.y);
        }
        return;
      }
      append_written(out, points.size() * (2 * kMaxDecimal + 2), [&](char* text) {
        for (const Point2 p : points) {
          *text++ = ',';
          text = put_mm(p.x, text);
          *text++ = ',';
          text = put_mm(p.y, text);
        }
        return text;
      });
    }

    /// A closed one ends with its first point.
    void polyline(std::uint32_t id, Direction direction, std::span<const Point2> line, bool closed) {
      if (form == CliForm::kShort) return short_polyline(id, direction, line, closed);
      const auto count = static_cast<std::uint32_t>(line.size() + (closed ? 1 : 0));
      if (form == CliForm::kLong) {
        put_little_endian(codes().polyline);
        for (const std::uint32_t field : {id, static_cast<std::uint32_t>(direction), count}) put_number(field);
      } else {
        append(out, fmt::format("$$POLYLINE/{},{},{}", id, static_cast<std::uint32_t>(direction), count));
      }
      points(line);
      if (closed) points(line.first(1));
      if (form == CliForm::kText) out.push_back('\n');
    }

    /// Points that fall on the one before are left out, and contours of which less than three are left. Open lines beyond
    /// 65535 points continue in another one.
    void short_polyline(std::uint32_t id, Direction direction, std::span<const Point2> line, bool closed) {
      const auto same = [&](Point2 a, Point2 b) {
        return in_units(a.x, unit) == in_units(b.x, unit) && in_units(a.y, unit) == in_units(b.y, unit);
      };
      while (closed && line.size() > 1 && same(line.back(), line.front())) line = line.first(line.size() - 1);
      const std::size_t begin = out.size();
      put_little_endian(codes().polyline);
      for (const std::uint32_t field : {id, static_cast<std::uint32_t>(direction), 0u}) put_number(field);
      const std::size_t first = out.size();
      std::uint32_t count = 0;
      std::size_t i = 0;
      for (Point2 last; i < line.size() && count < kMaxShort; ++i) {
        if (count > 0 && same(line[i], last)) continue;
        last = line[i];
        points({&last, 1});
        ++count;
      }
      if (count < (closed ? 3u : 2u)) return out.resize(begin);
      if (closed) points(line.first(1));
      count += closed ? 1 : 0;
      out[first - 2] = static_cast<char>(count & 0xFF);
      out[first - 1] = static_cast<char>(count >> 8);
      if (i < line.size()) short_polyline(id, direction, line.subspan(i - 1), closed);
    }

    /// Raster lines as hatches, the rest of a path as open polylines.
    void path(std::uint32_t id, const ToolpathsView& paths, std::uint32_t p) {
      std::uint32_t begin = paths.offset[p];
      const std::uint32_t last = paths.offset[p + 1] - 1;
      while (begin < last) {
        const bool hatch = is_hatch(paths, begin);
        std::uint32_t end = begin + 1;
        while (end < last && is_hatch(paths, end) == hatch && !(hatch && end - begin == kMaxShort)) ++end;
        if (!hatch) {
          polyline(id, kOpen, paths.point.subspan(begin, end - begin + 1), false);
        } else {
          if (form != CliForm::kText) {
            put_little_endian(codes().hatches);
            put_number(id);
            put_number(end - begin);
          } else {
            append(out, fmt::format("$$HATCHES/{},{}", id, end - begin));
          }
          for (std::uint32_t i = begin; i < end; ++i) points(paths.point.subspan(i, 2));
          if (form == CliForm::kText) out.push_back('\n');
        }
        begin = end;
      }
    }
  };

  CliForm form_;
  bool empty_first_;
};

Status CliEncoder::check(const SliceHead& head, const SliceLayer& layer) const {
  if (form_ != CliForm::kShort) return {};
  const std::int64_t unit = short_unit(head);
  const auto refuse = [&](const std::string& what) {
    return Error{Fault::kUsage, fmt::format("layer {}: --format cli-16: {}, or choose cli-binary", layer.layer.index, what)};
  };
  if (head.parts.size() > kMaxShort) return refuse("16 bits count up to 65535 bodies; give fewer parts");
  const std::int64_t bottom = layer.layer.bottom, top = bottom + layer.layer.thickness;
  if (in_units(bottom, unit) == in_units(top, unit)) {
    return refuse(fmt::format(
        "{} mm of thickness are lost in the unit of {} mm, which 16 bits need to reach all; give thicker layers, or move "
        "the parts nearer to the bed's corner with --at",
        mm(layer.layer.thickness), mm(unit)));
  }
  const auto outside = [&](Point2 p) {
    const std::int64_t low = std::min(p.x, p.y), high = std::max(p.x, p.y);
    return low < 0 || in_units(high, unit) > kMaxShort;
  };
  for (const std::span<const Point2> points : {layer.contours.point, layer.paths.point}) {
    const auto found = std::ranges::find_if(points, outside);
    if (found == points.end()) continue;
    return refuse(
        fmt::format("a point at {}, {} mm is outside the 65536 units of {} mm from the bed's corner; move the parts with --at",
                    mm(found->x), mm(found->y), mm(unit)));
  }
  for (std::uint32_t c = 0; c < layer.contours.size(); ++c) {
    if (layer.contours[c].size() < kMaxShort) continue;
    return refuse(fmt::format("a contour has {} points, and 16 bits count up to 65535; drop some with --tolerance",
                              layer.contours[c].size()));
  }
  return {};
}

}  // namespace

std::unique_ptr<SliceEncoder> make_cli_encoder(bool binary, const SliceFormatOptions& options) {
  return std::make_unique<CliEncoder>(binary ? CliForm::kLong : CliForm::kText, options.empty_first_layer);
}
std::unique_ptr<SliceEncoder> make_cli_16_encoder(const SliceFormatOptions& options) {
  return std::make_unique<CliEncoder>(CliForm::kShort, options.empty_first_layer);
}

}  // namespace lamina::formats
