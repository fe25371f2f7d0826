#include "pipeline/nest/sheet.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <set>
#include <utility>

#include "stages/formats/svg/svg_writer.h"

namespace lamina::pipeline {
namespace {

constexpr const char* kStyle =
    "@page{size:A4;margin:10mm}body{font:8pt sans-serif;margin:0;color:#111}h1{font-size:13pt;margin:0 0 1mm}"
    "p{margin:0 0 2mm}svg{width:100%;height:auto;display:block}.views{display:grid;grid-template-columns:1fr;gap:2mm}"
    ".above{max-width:120mm;margin:auto}.parts{columns:2;column-gap:5mm;margin-top:2mm}.top{margin-top:3mm}"
    ".part{display:grid;grid-template-columns:7mm 17mm 1.5fr 1fr 16mm 8mm;column-gap:1mm;border-bottom:0.1mm solid #bbb;break-inside:avoid;"
    "font-size:6.5pt;line-height:1.35}.part b{text-align:right;padding-right:1.5mm}.part span{overflow:hidden;white-space:nowrap;"
    "text-overflow:ellipsis}.sign{display:grid;grid-template-columns:1fr 1fr 1fr;gap:6mm;margin-top:9mm;break-inside:avoid}"
    ".sign div{border-top:0.3mm solid #111;padding-top:1mm}code{font-size:7pt}";

/// Cells of a shape as rectangles, in mm from its corner.
std::string path_of(const arrange::BitShape& shape, double cell_mm) {
  std::string path;
  for (std::uint32_t y = 0; y < shape.depth; ++y) {
    for (std::uint32_t x = 0; x < shape.width;) {
      if (!shape.at(x, y)) {
        ++x;
        continue;
      }
      const std::uint32_t begin = x;
      while (x < shape.width && shape.at(x, y)) ++x;
      path += fmt::format("M{:.4g} {:.4g}h{:.4g}v{:.4g}h-{:.4g}z", begin * cell_mm, y * cell_mm, (x - begin) * cell_mm, cell_mm,
                          (x - begin) * cell_mm);
    }
  }
  return path;
}

/// With room for the lines around a picture, mm.
std::string view_box(double width, double height) {
  const double around = width / 100;
  return fmt::format("{:.6g} {:.6g} {:.6g} {:.6g}", -around, -around, width + 2 * around, height + 2 * around);
}

/// The bed as a plan, y upwards.
std::string view_from_above(const NestPlan& plan, const NestBuild& build) {
  const double width = plan.bed_mm[0], depth = plan.bed_mm[1];
  std::string svg = fmt::format("<svg class=\"above\" viewBox=\"{}\"><defs>", view_box(width, depth));
  std::set<std::uint32_t> drawn;
  for (const NestedCopy& copy : build.copies) {
    if (drawn.insert(copy.picture).second)
      svg +=
          fmt::format("<path id=\"s{}\" d=\"{}\"/>", copy.picture, path_of(plan.pictures[copy.picture], plan.picture_cell_mm));
  }
  svg += "</defs><g stroke=\"#111\" stroke-width=\"0.4%\" fill=\"none\">";
  svg += plan.round
             ? fmt::format("<ellipse cx=\"{0:.6g}\" cy=\"{1:.6g}\" rx=\"{0:.6g}\" ry=\"{1:.6g}\"/></g>", width / 2, depth / 2)
             : fmt::format("<rect width=\"{:.6g}\" height=\"{:.6g}\"/></g>", width, depth);
  const double size = std::max(width, depth) / 55;
  std::size_t number = 0;
  std::string numbers;
  for (const NestedCopy& copy : build.copies) {
    svg += fmt::format("<use href=\"#s{}\" fill=\"#c8d2dc\" transform=\"translate({:.6g} {:.6g}) scale(1 -1)\"/>", copy.picture,
                       copy.x_mm, depth - copy.y_mm);
    numbers += fmt::format("<text x=\"{:.6g}\" y=\"{:.6g}\">{}</text>", copy.x_mm + copy.width_mm / 2,
                           depth - copy.y_mm - copy.depth_mm / 2 + size / 3, ++number);
  }
  return svg + fmt::format("<g font-size=\"{:.4g}\" text-anchor=\"middle\">", size) + numbers + "</g></svg>\n";
}

/// Boxes of parts from the front, the highest behind.
std::string view_from_the_side(const NestPlan& plan, const NestBuild& build) {
  const double width = plan.bed_mm[0], height = std::max(build.height_mm, width / 20);
  std::string svg = fmt::format(
      "<svg viewBox=\"{2}\"><rect width=\"{0:.6g}\" height=\"{1:.6g}\" fill=\"none\" "
      "stroke=\"#111\" stroke-width=\"0.3%\"/>",
      width, height, view_box(width, height));
  std::vector<std::size_t> order(build.copies.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order,
                           [&](std::size_t a, std::size_t b) { return build.copies[a].height_mm > build.copies[b].height_mm; });
  // Numbers stand below the tops of their parts, where none stands yet.
  const double size = width / 80;
  std::set<std::pair<long, long>> taken;
  std::string numbers;
  for (const std::size_t i : order) {
    const NestedCopy& copy = build.copies[i];
    svg += fmt::format(
        "<rect x=\"{:.6g}\" y=\"{:.6g}\" width=\"{:.6g}\" height=\"{:.6g}\" fill=\"#c8d2dc\" fill-opacity=\"0.6\" stroke=\"#567\" "
        "stroke-width=\"0.1%\"/>",
        copy.x_mm, height - copy.height_mm, copy.width_mm, copy.height_mm);
    const double x = copy.x_mm + copy.width_mm / 2, y = height - copy.height_mm + size;
    const std::pair cell{std::lround(x / size), std::lround(y / size)};
    bool free = true;
    for (long dx = -2; dx <= 2; ++dx)
      for (long dy = -1; dy <= 1; ++dy) free = free && !taken.contains({cell.first + dx, cell.second + dy});
    if (!free) continue;
    taken.insert(cell);
    numbers += fmt::format("<text x=\"{:.6g}\" y=\"{:.6g}\">{}</text>", x, std::min(y, height), i + 1);
  }
  svg += fmt::format("<g font-size=\"{:.4g}\" text-anchor=\"middle\">", size) + numbers + "</g>";
  return svg + "</svg>\n";
}

std::string part_list(const NestBuild& build, const std::vector<OrderRow>& rows,
                      const std::vector<std::vector<std::string>>& serials) {
  std::string html = "<div class=\"parts\">\n";
  std::size_t number = 0;
  for (const NestedCopy& copy : build.copies) {
    const OrderRow& row = rows[copy.row];
    html += fmt::format(
        "<div class=\"part\"><b>{}</b><span>{}</span><span>{}</span><span>{}</span><span>{:.1f}, {:.1f}</span><span>{:.1f}</span></div>\n",
        ++number, formats::svg_escaped(serials[copy.row][copy.copy]),
        formats::svg_escaped(std::filesystem::path(row.path).filename().string()),
        formats::svg_escaped(row.customer.empty() ? row.order : row.customer), copy.x_mm, copy.y_mm, copy.height_mm);
  }
  return html + "</div>\n";
}

/// "3 7 12 (48.0 mm), 1 2 (9.6 mm)": parts by the height of their tops.
std::string order_from_the_top(const NestBuild& build) {
  std::vector<std::size_t> order(build.copies.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order,
                           [&](std::size_t a, std::size_t b) { return build.copies[a].height_mm > build.copies[b].height_mm; });
  std::string text;
  for (std::size_t i = 0; i < order.size();) {
    const double height = build.copies[order[i]].height_mm;
    if (!text.empty()) text += ", ";
    std::size_t first = i;
    for (; i < order.size() && build.copies[order[i]].height_mm == height; ++i) {
      const bool continues = i > first && order[i] == order[i - 1] + 1;
      const bool more = i + 1 < order.size() && build.copies[order[i + 1]].height_mm == height && order[i + 1] == order[i] + 1;
      if (continues && more) continue;
      text += fmt::format("{}{}", continues ? "-" : i == first ? "" : " ", order[i] + 1);
    }
    text += fmt::format(" ({:.1f} mm)", height);
  }
  return text;
}

}  // namespace

std::string sheet_html(const SheetHead& head, const NestPlan& plan, const NestBuild& build, const std::vector<OrderRow>& rows,
                       const std::vector<std::vector<std::string>>& serials) {
  std::string html = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title><style>{1}</style></head>"
      "<body>\n<h1>{0}</h1>\n",
      formats::svg_escaped(head.title), kStyle);
  html += fmt::format(
      "<p>{} part{}{}{}; {:.3f} mm high, {:.3f} cm3 of parts, {:.1f} % of the bed covered</p>\n<p>Hash (XXH3-128) of plate.toml: <code>{}</code></p>\n",
      build.copies.size(), build.copies.size() == 1 ? "" : "s",
      build.material.empty() ? "" : " of " + formats::svg_escaped(build.material),
      head.machine.empty() ? "" : " on " + formats::svg_escaped(head.machine), build.height_mm, build.volume_mm3 / 1000,
      100 * build.area_mm2 / plan.bed_mm2, head.hash);
  if (build.use) {
    const cost::Use& job = build.use->quote.job;
    html += fmt::format("<p>{} layers, about {:.2f} h; {:.2f} l of powder dosed, {:.1f} ml of binder{}{}</p>\n",
                        build.use->layers, static_cast<double>(job.microseconds) / 3.6e9,
                        static_cast<double>(job.fed_nl) * 1e-9, static_cast<double>(job.binder_nl) * 1e-6,
                        head.presets.empty() ? "" : "; presets ", formats::svg_escaped(head.presets));
  }
  html += "<div class=\"views\">" + view_from_above(plan, build) + view_from_the_side(plan, build) + "</div>\n";
  html += "<p class=\"top\"><b>From the top</b>, when the powder is removed: " + order_from_the_top(build) + "</p>\n";
  html += "<p>Number, serial number, file, customer or order, position of the front left corner in mm, height in mm</p>\n";
  html += part_list(build, rows, serials);
  return html +
         "<div class=\"sign\"><div>Printed by, date</div><div>Unpacked by, date</div><div>Inspected by, date</div></div>\n</body></html>\n";
}

}  // namespace lamina::pipeline
