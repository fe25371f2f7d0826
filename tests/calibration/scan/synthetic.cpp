#include "tests/calibration/scan/synthetic.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lamina::test {
namespace {

struct PrintedBox {
  double left, top, right, bottom;
};

/// Adds the share of each cell that a box covers.
void cover_box(Sheet& sheet, const PrintedBox& box) {
  const double l = (box.left - sheet.left) / sheet.step, r = (box.right - sheet.left) / sheet.step;
  const double t = (box.top - sheet.top) / sheet.step, b = (box.bottom - sheet.top) / sheet.step;
  const auto share = [](double begin, double end, int cell) {
    return std::max(0.0, std::min(end, cell + 1.0) - std::max(begin, static_cast<double>(cell)));
  };
  for (int y = std::max(0, static_cast<int>(t)); y < sheet.rows && y < b; ++y) {
    const double high = share(t, b, y);
    float* row = sheet.cover.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(sheet.columns);
    for (int x = std::max(0, static_cast<int>(l)); x < sheet.columns && x < r; ++x)
      row[x] = std::min(1.0f, row[x] + static_cast<float>(high * share(l, r, x)));
  }
}

/// What the dots of a line that lie one behind the other become, by lines and places of the scan (data/program.h): one box, for
/// two that overlap would darken the edges of each other.
template <class Visit>
void for_each_dot_line(const HeadGrid& grid, const RunsView& layer, const Visit& visit) {
  const std::uint32_t columns = layer.columns, rows = layer.rows();
  if (grid.scan_axis == ScanAxis::kX) {
    for (std::uint32_t r = 0; r < rows; ++r) {
      const auto row = layer.row(r);
      for (std::size_t i = 0; i + 1 < row.size(); i += 2)
        visit(grid.lines_from_end ? rows - 1 - r : r, row[i], r, row[i + 1], r + 1);
    }
    return;
  }
  std::vector<std::uint32_t> begin(columns, 0), end(columns, 0);
  const auto close = [&](std::uint32_t c) {
    if (begin[c] < end[c]) visit(grid.lines_from_end ? columns - 1 - c : c, c, begin[c], c + 1, end[c]);
  };
  for (std::uint32_t r = 0; r < rows; ++r) {
    const auto row = layer.row(r);
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
      for (std::uint32_t c = row[i]; c < row[i + 1]; ++c) {
        if (end[c] != r || begin[c] == end[c]) close(c), begin[c] = r;
        end[c] = r + 1;
      }
    }
  }
  for (std::uint32_t c = 0; c < columns; ++c) close(c);
}

void blur(std::vector<float>& light, int width, int height, double sigma) {
  if (!(sigma > 0)) return;
  const int reach = static_cast<int>(std::ceil(3 * sigma));
  std::vector<float> weight;
  float sum = 0;
  for (int i = -reach; i <= reach; ++i)
    sum += weight.emplace_back(static_cast<float>(std::exp(-0.5 * i * i / (sigma * sigma))));
  for (float& w : weight) w /= sum;
  std::vector<float> other(light.size());
  const auto pass = [&](const std::vector<float>& from, std::vector<float>& to, int stride, int length, int lines,
                        int line_stride) {
    for (int k = 0; k < lines; ++k) {
      for (int i = 0; i < length; ++i) {
        float value = 0;
        for (int j = -reach; j <= reach; ++j)
          value += weight[static_cast<std::size_t>(j + reach)] *
                   from[static_cast<std::size_t>(k * line_stride + std::clamp(i + j, 0, length - 1) * stride)];
        to[static_cast<std::size_t>(k * line_stride + i * stride)] = value;
      }
    }
  };
  pass(light, other, 1, width, height, width);
  pass(other, light, width, height, width, 1);
}

double srgb(double light) { return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055; }

float cover_at(const Sheet& sheet, double x_mm, double y_mm) {
  const double x = (x_mm - sheet.left) / sheet.step - 0.5, y = (y_mm - sheet.top) / sheet.step - 0.5;
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
  if (i < 0 || j < 0 || i + 1 >= sheet.columns || j + 1 >= sheet.rows) return 0;
  const auto u = static_cast<float>(x - i), v = static_cast<float>(y - j);
  const float* a = sheet.cover.data() + static_cast<std::size_t>(j) * static_cast<std::size_t>(sheet.columns) + i;
  const float* b = a + sheet.columns;
  return (1 - v) * ((1 - u) * a[0] + u * a[1]) + v * ((1 - u) * b[0] + u * b[1]);
}

}  // namespace

Sheet print_sheet(const HeadGrid& grid, const RunsView& layer, const Printing& printing) {
  const bool along_x = grid.scan_axis == ScanAxis::kX;
  const double x_mm = (along_x ? grid.position_nm : grid.line_nm) * 1e-6,
               y_mm = (along_x ? grid.line_nm : grid.position_nm) * 1e-6;
  std::uint32_t box[4] = {UINT32_MAX, UINT32_MAX, 0, 0};
  for_each_dot_line(grid, layer, [&](std::uint32_t, std::uint32_t l, std::uint32_t t, std::uint32_t r, std::uint32_t b) {
    box[0] = std::min(box[0], l), box[1] = std::min(box[1], t), box[2] = std::max(box[2], r), box[3] = std::max(box[3], b);
  });
  Sheet sheet;
  sheet.left = box[0] * x_mm - 1;
  sheet.top = box[1] * y_mm - 1;
  sheet.columns = static_cast<int>(((box[2] - box[0]) * x_mm + 2) / sheet.step);
  sheet.rows = static_cast<int>(((box[3] - box[1]) * y_mm + 2) / sheet.step);
  sheet.cover.assign(static_cast<std::size_t>(sheet.columns) * static_cast<std::size_t>(sheet.rows), 0);
  // Places rise to the right and to the front, or the other way; so do lines.
  const double along_sign = along_x ? (grid.positions_from_end ? -1 : 1) : (grid.positions_from_end ? 1 : -1);
  const double across_sign = grid.lines_from_end ? -1 : 1, gain = printing.gain_um * 1e-3;
  std::mt19937_64 random(printing.seed);
  std::normal_distribution<double> jitter(0, printing.jitter_um * 1e-3 + 1e-12);
  std::uniform_real_distribution<double> unit(0, 1);
  for_each_dot_line(grid, layer, [&](std::uint32_t line, std::uint32_t l, std::uint32_t t, std::uint32_t r, std::uint32_t b) {
    const std::uint32_t swath = line / grid.swath_lines(), nozzle = line % grid.swath_lines() / grid.passes;
    if (printing.blocked.contains(nozzle) || printing.skips(line)) return;
    double along = 0, across = 0;
    if (!printing.nozzle.empty()) along += printing.nozzle[nozzle][0], across += printing.nozzle[nozzle][1];
    if (!printing.swath.empty()) along += printing.swath[swath][0], across += printing.swath[swath][1];
    along *= along_sign, across *= across_sign;
    const double dx = along_x ? along : across, dy = along_x ? across : along;
    if (printing.jitter_um == 0 && printing.satellites == 0) {
      cover_box(sheet, {(l + dx) * x_mm - gain, (t + dy) * y_mm - gain, (r + dx) * x_mm + gain, (b + dy) * y_mm + gain});
      return;
    }
    for (std::uint32_t k = 0; k < (along_x ? r - l : b - t); ++k) {  // dot by dot
      const double x = (l + (along_x ? k : 0) + dx) * x_mm + jitter(random), y = (t + (along_x ? 0 : k) + dy) * y_mm + jitter(random);
      cover_box(sheet, {x - gain, y - gain, x + x_mm + gain, y + y_mm + gain});
      if (unit(random) >= printing.satellites) continue;
      const double sx = x + (along_x ? along_sign * 0.06 : 0), sy = y + (along_x ? 0 : along_sign * 0.06);
      cover_box(sheet, {sx + 0.3 * x_mm, sy + 0.3 * y_mm, sx + 0.7 * x_mm, sy + 0.7 * y_mm});
    }
  });
  return sheet;
}

GreyPicture photograph(const Sheet& sheet, const Camera& camera, std::mt19937_64& random) {
  const double wide = sheet.columns * sheet.step, high = sheet.rows * sheet.step,
               turn = camera.turn_deg * std::numbers::pi / 180;
  const double c = std::cos(turn), s = std::sin(turn), scale = camera.pixels_a_mm;
  GreyPicture picture;
  picture.width = static_cast<int>((std::abs(wide * c) + std::abs(high * s) + 2 * camera.margin_mm) * scale);
  picture.height = static_cast<int>((std::abs(wide * s) + std::abs(high * c) + 2 * camera.margin_mm) * scale);
  const double mx = 0.5 * picture.width, my = 0.5 * picture.height, radius = std::hypot(mx, my);
  std::vector<float> light(static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height));
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      float cover = 0;
      for (const double oy : {-0.25, 0.25}) {
        for (const double ox : {-0.25, 0.25}) {
          double px = x + 0.5 + ox - mx, py = y + 0.5 + oy - my;
          const double grown = 1 + camera.lens * (px * px + py * py) / (radius * radius);
          px *= grown / scale, py *= grown / scale;
          const double w = 1 + camera.tilt_x * px / (0.5 * wide) + camera.tilt_y * py / (0.5 * high);
          px /= w, py /= w;
          cover += 0.25f * cover_at(sheet, sheet.left + 0.5 * wide + c * px + s * py, sheet.top + 0.5 * high - s * px + c * py);
        }
      }
      const double u = (x - mx) / mx, v = (y - my) / my, r = std::hypot(x - mx, y - my) / radius;
      const double lamp = 1 + camera.shade_x * u + camera.shade_y * v - camera.vignette * r * r;
      light[static_cast<std::size_t>(y * picture.width + x)] =
          static_cast<float>(lamp * (camera.paper + (camera.ink - camera.paper) * static_cast<double>(cover)));
    }
  }
  std::uniform_real_distribution<double> unit(0, 1);
  for (std::uint32_t i = 0; i < camera.dark_specks + camera.bright_specks; ++i) {
    const double r = (0.03 + 0.22 * unit(random)) * scale, x = unit(random) * picture.width, y = unit(random) * picture.height;
    const auto value = static_cast<float>(i < camera.dark_specks ? 0.5 * camera.ink + 0.1 * unit(random) : camera.paper);
    for (int j = static_cast<int>(y - r); j <= y + r; ++j) {
      for (int k = static_cast<int>(x - r); k <= x + r; ++k) {
        if (j < 0 || k < 0 || j >= picture.height || k >= picture.width || std::hypot(j - y, k - x) > r) continue;
        light[static_cast<std::size_t>(j * picture.width + k)] = value;
      }
    }
  }
  if (camera.grain > 0) {
    std::vector<float> grain(light.size());
    const double spot = 0.05 * scale;  // pixels; blurring white noise divides it by 2 sqrt(pi) times that
    std::normal_distribution<float> white(0, static_cast<float>(camera.grain * 2 * std::sqrt(std::numbers::pi) * spot));
    for (float& one : grain) one = white(random);
    blur(grain, picture.width, picture.height, spot);
    for (std::size_t i = 0; i < light.size(); ++i) light[i] *= 1 + grain[i];
  }
  blur(light, picture.width, picture.height, camera.blur_pixels);
  std::normal_distribution<float> noise(0, static_cast<float>(camera.noise));
  picture.grey.resize(light.size());
  for (std::size_t i = 0; i < light.size(); ++i) {
    const double grey = 255 * srgb(std::clamp(static_cast<double>(light[i]), 0.0, 1.0)) + static_cast<double>(noise(random));
    picture.grey[i] = static_cast<std::uint8_t>(std::clamp(std::lround(grey), 0l, 255l));
  }
  return picture;
}

}  // namespace lamina::test
