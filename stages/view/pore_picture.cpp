#include "stages/view/pore_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stages/data/plot.h"

namespace lamina::view {
namespace {

constexpr int kMargin = 24, kSide = 540, kGap = 40, kFoot = 34, kHead = 22;  // pixels; of a panel: side, below, above
constexpr int kBarGap = 28, kBarWidth = 18, kBarSpace = 110;
constexpr int kShades = 200;
constexpr const char *kInk = "2b2f36", *kPale = "6b7280";
enum Pixel : std::uint8_t { kDarkGrey, kPaleGrey, kThrough, kClosed, kLine, kFirstShade };

std::vector<std::string> palette() {
  std::vector<std::string> colours = {"8b919b", "a4aab3", "a8d5ee", "f0b35e", "5f6670"};
  for (int i = 0; i < kShades; ++i) colours.push_back(scale_colour(i / (kShades - 1.0)));
  return colours;
}

double length_mm(const VoxelView& box, std::size_t a) { return mm(std::int64_t{box.edge[a]} * box.size()[a]); }

bool is_set(const VoxelView& box, const std::array<std::uint32_t, 3>& at) {
  const auto row = box.row(at[1], at[2]);
  return (std::ranges::upper_bound(row, at[0]) - row.begin()) % 2 != 0;
}

/// One section: what of it is shown, and how large.
struct Panel {
  int normal = 2;
  std::array<std::size_t, 2> axis{};      // to the right, upwards
  std::array<double, 2> from{}, shown{};  // mm; of what repeats, below 0 too
  double scale = 1;                       // pixels a mm
  int left = 0, top = 0, columns = 0, rows = 0;
};

Panel panel_of(const PorePicture& picture, int normal) {
  const VoxelView& box = picture.solid;
  Panel panel;
  panel.normal = normal;
  panel.axis = {static_cast<std::size_t>(column_axis(normal)), static_cast<std::size_t>(row_axis(normal))};
  const double longer = std::max(length_mm(box, panel.axis[0]), length_mm(box, panel.axis[1]));
  const bool alone = std::ranges::all_of(panel.axis, [&](std::size_t a) {
    return box.periodic[a] && std::lround(longer / length_mm(box, a)) == 1;  // a cell by itself says little: show four
  });
  for (std::size_t k = 0; k < 2; ++k) {
    const std::size_t a = panel.axis[k];
    const double length = length_mm(box, a);
    panel.shown[k] = length;
    if (!box.periodic[a]) continue;
    panel.shown[k] *= static_cast<double>(alone ? 2 : std::lround(longer / length));
    panel.from[k] = (picture.position[a] + 0.5) * mm(box.edge[a]) - panel.shown[k] / 2;
  }
  panel.scale = std::min(kSide / panel.shown[0], kSide / panel.shown[1]);
  panel.columns = std::max(1, static_cast<int>(std::lround(panel.scale * panel.shown[0])));
  panel.rows = std::max(1, static_cast<int>(std::lround(panel.scale * panel.shown[1])));
  return panel;
}

/// Between the middles of voxels in proportion.
double value_at(const Plane& plane, double column, double row, bool around_columns, bool around_rows) {
  struct Pair {
    std::uint32_t low, high;
    double share;
  };
  const auto pair = [](double at, std::uint32_t size, bool around) {
    const double below = std::floor(at - 0.5);
    const auto index = [&](double i) {
      const double last = size - 1.0;
      return static_cast<std::uint32_t>(around ? (i < 0 ? last : i > last ? 0 : i) : std::clamp(i, 0.0, last));
    };
    return Pair{index(below), index(below + 1), at - 0.5 - below};
  };
  const Pair c = pair(column, plane.columns, around_columns), r = pair(row, plane.rows, around_rows);
  const auto in_row = [&](std::uint32_t at) {
    const float* value = plane.value.data() + std::size_t{plane.columns} * at;
    return (1 - c.share) * value[c.low] + c.share * value[c.high];
  };
  return (1 - r.share) * in_row(r.low) + r.share * in_row(r.high);
}

struct ValueRange {
  double low = 0, high = 1;
};

/// Of both sections; below 0 only if something flows back that the colours can show.
ValueRange range_of(const PorePicture& picture) {
  ValueRange range{0, 0};
  for (const Plane* plane : {picture.across, picture.along}) {
    for (const float value : plane->value) {
      range.low = std::min<double>(range.low, value);
      range.high = std::max<double>(range.high, value);
    }
  }
  if (!(range.high > 0)) range.high = 1;
  if (range.low > -0.02 * range.high) range.low = 0;
  return range;
}

/// Where a point of a section lies in the box.
struct Point {
  std::array<std::uint32_t, 3> voxel{};
  std::array<double, 2> share{};  // of the box, 0 .. 1, to the right and upwards
  std::uint32_t layer = 0;        // from the first of the box on
};

Point point_at(const PorePicture& picture, const Panel& panel, int column, int row) {
  Point point;
  point.voxel = picture.position;
  double tiles_of_z = 0, z = 0;
  for (std::size_t k = 0; k < 2; ++k) {
    const std::size_t a = panel.axis[k];
    const double length = length_mm(picture.solid, a);
    const double pixel = k == 0 ? column + 0.5 : panel.rows - row - 0.5;
    const double at = panel.from[k] + pixel / (k == 0 ? panel.columns : panel.rows) * panel.shown[k];
    const double tiles = std::floor(at / length), share = at / length - tiles;
    const std::uint32_t size = picture.solid.size()[a];
    point.share[k] = share;
    point.voxel[a] = std::min(size - 1, static_cast<std::uint32_t>(share * size));
    if (a == 2) tiles_of_z = tiles, z = share * length;
  }
  const auto& tops = picture.layer_tops_mm;
  const auto layer = std::ranges::upper_bound(tops, z) - tops.begin();
  point.layer = static_cast<std::uint32_t>(layer + (static_cast<std::ptrdiff_t>(tiles_of_z) + 1024) * std::ssize(tops));
  return point;
}

/// plane  none: solid and void, else by its values
Plot::Image image_of(const PorePicture& picture, const Panel& panel, const Plane* plane, const ValueRange& range) {
  const auto& around = picture.solid.periodic;
  Plot::Image image{panel.left, panel.top, panel.columns, palette(), {}};
  image.pixels.reserve(static_cast<std::size_t>(panel.columns) * static_cast<std::size_t>(panel.rows));
  for (int row = 0; row < panel.rows; ++row) {
    for (int column = 0; column < panel.columns; ++column) {
      const Point at = point_at(picture, panel, column, row);
      if (is_set(picture.solid, at.voxel)) {
        image.pixels.push_back(panel.normal != 2 && at.layer % 2 != 0 ? kPaleGrey : kDarkGrey);
      } else if (plane == nullptr) {
        image.pixels.push_back(is_set(picture.through, at.voxel) ? kThrough : kClosed);
      } else {
        const double value = value_at(*plane, at.share[0] * plane->columns, at.share[1] * plane->rows, around[panel.axis[0]],
                                      around[panel.axis[1]]);
        const double shade = (value - range.low) / (range.high - range.low) * (kShades - 1);
        image.pixels.push_back(static_cast<std::uint8_t>(kFirstShade + std::lround(std::clamp(shade, 0.0, kShades - 1.0))));
      }
    }
  }
  return image;
}

/// The middles of beads upon these, point by point; what lies beyond the box repeats within it, or is not drawn.
void draw_lines(const PorePicture& picture, const Panel& panel, Plot::Image& image) {
  const VoxelView& box = picture.solid;
  const double length[2] = {length_mm(box, 0), length_mm(box, 1)};
  const auto put = [&](double x, double y) {
    const double column = (x - panel.from[0]) * panel.scale, row = panel.rows - (y - panel.from[1]) * panel.scale;
    if (column < 0 || row < 0 || column >= panel.columns || row >= panel.rows) return;
    std::uint8_t& pixel =
        image
            .pixels[static_cast<std::size_t>(row) * static_cast<std::size_t>(panel.columns) + static_cast<std::size_t>(column)];
    if (pixel == kDarkGrey) pixel = kLine;
  };
  for (const auto& [from, to] : picture.lines) {
    const double x = mm(from.x) - picture.corner_mm[0], y = mm(from.y) - picture.corner_mm[1];
    const double dx = mm(std::int64_t{to.x} - from.x), dy = mm(std::int64_t{to.y} - from.y);
    const auto steps = static_cast<int>(2 * panel.scale * std::hypot(dx, dy)) + 1;
    for (int i = 0; i <= steps; ++i) {
      const double at_x = x + dx * i / steps, at_y = y + dy * i / steps;
      if (at_x < 0 || at_y < 0 || at_x >= length[0] || at_y >= length[1]) continue;
      for (double tile_y = std::floor(panel.from[1] / length[1]) * length[1]; tile_y < panel.from[1] + panel.shown[1];
           tile_y += length[1])
        for (double tile_x = std::floor(panel.from[0] / length[0]) * length[0]; tile_x < panel.from[0] + panel.shown[0];
             tile_x += length[0])
          put(at_x + tile_x, at_y + tile_y);
    }
  }
}

/// Ticks outside of a panel where the other section cuts it.
void mark_cut(const PorePicture& picture, const Panel& panel, int normal, Plot& plot) {
  const auto a = static_cast<std::size_t>(normal);
  const std::size_t k = panel.axis[0] == a ? 0 : 1;
  const double mm_from = (picture.position[a] + 0.5) * mm(picture.solid.edge[a]) - panel.from[k];
  const double share = mm_from / panel.shown[k], right = panel.left + panel.columns, bottom = panel.top + panel.rows;
  if (k == 0) {
    const double x = panel.left + share * panel.columns;
    plot.lines.push_back({{{x, panel.top - 7.0}, {x, panel.top - 1.0}}, kInk});
    plot.lines.push_back({{{x, bottom + 1}, {x, bottom + 7}}, kInk});
  } else {
    const double y = bottom - share * panel.rows;
    plot.lines.push_back({{{panel.left - 7.0, y}, {panel.left - 1.0, y}}, kInk});
    plot.lines.push_back({{{right + 1, y}, {right + 7, y}}, kInk});
  }
}

void add_panel(const PorePicture& picture, const Panel& panel, const Plane* plane, const ValueRange& range,
               const std::string& caption, Plot& plot) {
  plot.images.push_back(image_of(picture, panel, plane, range));
  if (plane == nullptr && panel.normal == 2) draw_lines(picture, panel, plot.images.back());
  mark_cut(picture, panel, panel.normal == picture.axis ? picture.normal : picture.axis, plot);
  plot.texts.push_back({double(panel.left), panel.top - 12.0, 14, Plot::Anchor::kStart, kInk, caption});
  const double length = tick_step(panel.shown[0], 5), bottom = panel.top + panel.rows;
  plot.boxes.push_back({double(panel.left), bottom + 12, length * panel.scale, 4, kInk});
  plot.texts.push_back(
      {panel.left + length * panel.scale + 8, bottom + 19, 12, Plot::Anchor::kStart, kInk, fmt::format("{:g} mm", length)});
  plot.texts.push_back({double(panel.left + panel.columns), bottom + 19, 12, Plot::Anchor::kEnd, kPale,
                        fmt::format("{} to the right, {} upwards", "xyz"[panel.axis[0]], "xyz"[panel.axis[1]])});
}

void add_scale(int left, int top, int rows, const ValueRange& range, Plot& plot) {
  Plot::Image bar{left, top, kBarWidth, palette(), {}};
  for (int row = 0; row < rows; ++row) {
    const auto shade = std::lround((rows - row - 0.5) / rows * (kShades - 1));
    bar.pixels.insert(bar.pixels.end(), kBarWidth, static_cast<std::uint8_t>(kFirstShade + shade));
  }
  plot.images.push_back(std::move(bar));
  plot.texts.push_back({double(left), top - 12.0, 14, Plot::Anchor::kStart, kInk, "v / mean"});
  const double step = tick_step(range.high - range.low, 8);
  for (double i = std::ceil(range.low / step); i * step <= range.high * (1 + 1e-9); ++i) {
    const double y = top + rows * (1 - (i * step - range.low) / (range.high - range.low));
    plot.lines.push_back({{{left + kBarWidth + 1.0, y}, {left + kBarWidth + 6.0, y}}, kInk});
    plot.texts.push_back({left + kBarWidth + 10.0, y + 4, 12, Plot::Anchor::kStart, kInk, fmt::format("{:.4g}", i * step)});
  }
}

double percent(std::uint64_t voxels, const VoxelView& box) {
  return 100 * static_cast<double>(voxels) / static_cast<double>(std::max<std::uint64_t>(1, box.voxels()));
}

/// Squares and what they mean, with shares of the window.
void add_legend(const PorePicture& picture, int top, Plot& plot) {
  const std::uint64_t solid = set_voxels(picture.solid), leads = set_voxels(picture.through),
                      rest = picture.solid.voxels() - solid - leads;
  const std::vector<std::string> colours = palette();
  const bool layers = picture.layer_tops_mm.size() > 0;
  double x = kMargin;
  const auto entry = [&](Pixel colour, const std::string& line) {
    plot.boxes.push_back({x, double(top), 14, 14, colours[colour]});
    if (colour == kDarkGrey && layers) plot.boxes.push_back({x, double(top), 14, 7, colours[kPaleGrey]});
    plot.texts.push_back({x + 20, top + 12.0, 13, Plot::Anchor::kStart, kInk, line});
    x += 48 + 7.6 * static_cast<double>(line.size());
  };
  entry(kDarkGrey, fmt::format("{} {:.2f} %{}", picture.solid_name, percent(solid, picture.solid),
                               layers ? ", layers in two alternating greys, lines at their centres" : ""));
  entry(kThrough, fmt::format("void connected along {} {:.2f} %", "xyz"[picture.axis], percent(leads, picture.solid)));
  entry(kClosed, fmt::format("other void {:.2f} %", percent(rest, picture.solid)));
}

/// Of linear light 0 .. 1, as sRGB has it (IEC 61966-2-1).
int byte_of(double light) {
  light = std::clamp(light, 0.0, 1.0);
  const double value = light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
  return static_cast<int>(std::lround(255 * value));
}

}  // namespace

Plot draw_pores(const PorePicture& picture) {
  Plot plot;
  plot.width = kMargin + 2 * kSide + kGap + kBarGap + kBarSpace;
  plot.texts.push_back({kMargin, 36, 20, Plot::Anchor::kStart, kInk, picture.title});
  int top = 40;
  for (const std::string& line : picture.captions)
    plot.texts.push_back({kMargin, double(top += 19), 13, Plot::Anchor::kStart, kPale, line});
  Panel across = panel_of(picture, picture.axis), along = panel_of(picture, picture.normal);
  const char axis = "xyz"[picture.axis];
  const auto where = [&](int normal) {
    const auto a = static_cast<std::size_t>(normal);
    return fmt::format("{} = {:.3f} mm", "xyz"[normal],
                       picture.corner_mm[a] + (picture.position[a] + 0.5) * mm(picture.solid.edge[a]));
  };
  across.left = kMargin;
  along.left = kMargin + kSide + kGap;
  const int tall = std::max(across.rows, along.rows);
  const auto next_row = [&] {
    across.top = along.top = top += kHead + 14;
    top += tall + kFoot;
  };
  const bool flows = picture.across != nullptr && picture.along != nullptr;
  if (flows) {
    const ValueRange range = range_of(picture);
    next_row();
    add_panel(picture, across, picture.across, range,
              fmt::format("(a) velocity along {} where it is fastest, {}", axis, where(picture.axis)), plot);
    add_panel(picture, along, picture.along, range, fmt::format("(b) speed along the fastest pore, {}", where(picture.normal)),
              plot);
    add_scale(along.left + along.columns + kBarGap, along.top, tall, range, plot);
  }
  next_row();
  const std::string& solid = picture.solid_name;
  add_panel(picture, across, nullptr, {},
            flows ? fmt::format("(c) {} and pores in the plane of a", solid)
                  : fmt::format("(a) {} and pores across {}, {}", solid, axis, where(picture.axis)),
            plot);
  add_panel(picture, along, nullptr, {},
            flows ? fmt::format("(d) {} and pores in the plane of b", solid)
                  : fmt::format("(b) {} and pores along {}, {}", solid, axis, where(picture.normal)),
            plot);
  add_legend(picture, top + 4, plot);
  plot.height = top + 40;
  return plot;
}

std::string scale_colour(double share) {
  share = std::clamp(share, 0.0, 1.0);
  const double lightness = 0.22 + 0.74 * share, hue = (270 + 200 * share) * std::numbers::pi / 180;
  const double chroma = 0.07 + 0.11 * std::sin(std::numbers::pi * std::min(1.0, 0.1 + share));
  const double a = chroma * std::cos(hue), b = chroma * std::sin(hue);
  const auto cubed = [](double x) { return x * x * x; };
  const double l = cubed(lightness + 0.3963377774 * a + 0.2158037573 * b),
               m = cubed(lightness - 0.1055613458 * a - 0.0638541728 * b),
               s = cubed(lightness - 0.0894841775 * a - 1.2914855480 * b);
  return fmt::format("{:02x}{:02x}{:02x}", byte_of(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s),
                     byte_of(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s),
                     byte_of(-0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s));
}

}  // namespace lamina::view
