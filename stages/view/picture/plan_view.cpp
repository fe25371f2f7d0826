#include "stages/view/picture/plan_view.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "stages/data/grid.h"
#include "stages/view/picture/canvas.h"
#include "stages/view/picture/contact_sheet.h"

namespace lamina::view::picture {
namespace {

constexpr Colour kGround{255, 255, 255}, kPaper{244, 244, 246}, kSolid{205, 209, 216}, kText{40, 44, 52};

Colour colour_of(const Ink& ink) { return {ink[0], ink[1], ink[2]}; }

/// The layer within a panel of the canvas.
void paint(Canvas& canvas, const LayerShapes& shapes, const Scale& scale, int left, int top, int width, int height) {
  canvas.fill_box(left, top, width, height, kPaper);
  canvas.paint(left, top, width, contour_shares(shapes.contours, scale, width, height), kSolid);
  for (const LayerShapes::Beads& beads : shapes.beads)
    canvas.paint(left, top, width, contour_shares(beads.outline, scale, width, height), colour_of(beads.ink));
}

struct LegendEntry {
  Colour ink;
  std::string name, type;
};

void add_entries(std::vector<LegendEntry>& entries, const LayerShapes& shapes) {
  for (const LayerShapes::Beads& beads : shapes.beads) {
    if (std::ranges::none_of(entries, [&](const LegendEntry& entry) { return entry.name == beads.name; }))
      entries.push_back({colour_of(beads.ink), beads.name, beads.type.empty() ? beads.name : beads.type});
  }
}

/// The last shade of each type, then the others.
void put_types_first(std::vector<LegendEntry>& entries) {
  std::vector<LegendEntry> firsts, others;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const bool later = std::any_of(entries.begin() + static_cast<std::ptrdiff_t>(i) + 1, entries.end(),
                                   [&](const LegendEntry& entry) { return entry.type == entries[i].type; });
    (later ? others : firsts).push_back(entries[i]);
  }
  firsts.insert(firsts.end(), others.begin(), others.end());
  entries = std::move(firsts);
}

/// A square of each ink and what it is for, from `left` on. Where there is no room for all up to `right`, each type has one
/// before any has a second.
void legend(Canvas& canvas, std::vector<LegendEntry> entries, int left, int right, int baseline, int size) {
  if (!have_font()) return;
  int end = left - size * 4 / 3;
  for (const LegendEntry& entry : entries) end += size + text_width(entry.name, size) + size * 4 / 3;
  if (end > right) put_types_first(entries);
  for (const auto& [ink, name, type] : entries) {
    if (left + size + text_width(name, size) > right) return canvas.text(left, baseline, size, "...", kText);
    canvas.fill_box(left, baseline - size * 3 / 4, size * 3 / 4, size * 3 / 4, ink);
    canvas.text(left + size, baseline, size, name, kText);
    left += size + text_width(name, size) + size * 4 / 3;
  }
}

}  // namespace

Result<Buffer<std::byte>> plan_sheet(const std::string& title, std::size_t layers, const Box& box, std::uint32_t width,
                                     const std::function<Result<LayerShapes>(std::size_t)>& shapes_of) {
  constexpr std::int64_t kPixels = 20'000, kMinPixel = 1000;  // of the longer side: no cell is as large; nm
  const std::int64_t shown = std::max<std::int64_t>(box.width(), 1000) * 26 / 25,
                     tall = std::max<std::int64_t>(box.depth(), 1000) * 26 / 25;
  const std::int64_t side = std::max(shown, tall), dots = std::min(kPixels, side / kMinPixel);
  const PixelGrid grid{PixelAxis(dots, shown, side), PixelAxis(dots, tall, side)};
  const SheetLayout layout =
      layout_chart(static_cast<int>(layers), {0, grid.columns(), 0, grid.rows()}, grid, static_cast<int>(width));
  Canvas canvas(layout.width, layout.height, kGround);
  const double pixels_per_nm = layout.picture_width / static_cast<double>(shown);
  const Scale scale{(static_cast<double>(box.lo.x) + box.hi.x) / 2 - static_cast<double>(shown) / 2,
                    (static_cast<double>(box.lo.y) + box.hi.y) / 2 + static_cast<double>(tall) / 2, pixels_per_nm};
  std::vector<LegendEntry> inks;
  for (std::size_t i = 0; i < layers; ++i) {
    const Result<LayerShapes> shapes = shapes_of(i);
    if (!shapes) return shapes.error();
    const int cell = static_cast<int>(i), size = layout.caption_size, left = layout.cell_left(cell);
    paint(canvas, *shapes, scale, left + (layout.cell_width - layout.picture_width) / 2, layout.cell_top(cell),
          layout.picture_width, layout.picture_height);
    const int baseline = layout.cell_top(cell) + layout.cell_height + size * 5 / 4, remark = text_width(shapes->caption, size);
    canvas.text(left, baseline, size, shapes->title, kText);
    if (text_width(shapes->title, size) + size / 2 + remark <= layout.cell_width) {
      canvas.text(left + layout.cell_width - remark, baseline, size, shapes->caption, kText);
    }
    add_entries(inks, *shapes);
  }
  canvas.text(layout.margin, layout.margin + layout.title_size, layout.title_size, title, kText);
  legend(canvas, inks, layout.margin + text_width(title, layout.title_size) + layout.title_size, layout.width,
         layout.margin + layout.title_size, layout.title_size * 3 / 4);
  return canvas.png();
}

Result<Buffer<std::byte>> plan_view(const LayerShapes& shapes, std::uint32_t picture_width) {
  const int width = static_cast<int>(picture_width), size = std::clamp(width / 60, 14, 48), margin = size;
  const double shown = static_cast<double>(std::max<std::int64_t>(shapes.box.width(), 1000));
  const double tall = static_cast<double>(std::max<std::int64_t>(shapes.box.depth(), 1000));
  const double pixels_per_nm = std::min((width - 2 * margin) / (shown * 1.04), 4.0 * width / (tall * 1.04));
  const int height = std::max(1, static_cast<int>(std::ceil(tall * 1.04 * pixels_per_nm)));
  const int head = have_font() ? 3 * size + size / 2 : margin, panel = width - 2 * margin;
  const double middle = (static_cast<double>(shapes.box.lo.x) + shapes.box.hi.x) / 2;
  const Scale scale{middle - panel / pixels_per_nm / 2, shapes.box.hi.y + tall * 0.02, pixels_per_nm};

  Canvas canvas(width, head + height + margin, kGround);
  paint(canvas, shapes, scale, margin, head, panel, height);
  canvas.text(margin, size + size / 2, size, shapes.title, kText);
  int left = margin;
  const int small = size * 3 / 4, line = 2 * size + size / 2 + size / 4;
  canvas.text(left, line, small, shapes.caption, kText);
  left += text_width(shapes.caption, small) + size;
  std::vector<LegendEntry> inks;
  add_entries(inks, shapes);
  legend(canvas, inks, left, width, line, small);
  return canvas.png();
}

}  // namespace lamina::view::picture
