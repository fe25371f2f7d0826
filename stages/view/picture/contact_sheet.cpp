#include "stages/view/picture/contact_sheet.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <utility>

#include "stages/geometry/combine.h"
#include "stages/support/memory_gate.h"
#include "stages/view/picture/canvas.h"

namespace lamina::view::picture {
namespace {

// Sizes on a sheet of this width; others in proportion, within limits at which text can still be read.
constexpr double kDesignWidth = 2400;
constexpr double kMinScale = 0.45, kMaxScale = 2;
constexpr double kWantedProportion = 1.5;
// A cell is at most so many times as high as it is wide; a picture that is higher becomes narrower.
constexpr int kMaxHeight = 3;

int scaled(double size, double scale) { return static_cast<int>(std::lround(size * scale)); }

SheetLayout with_columns(int columns, int cells, double proportion, int width, double scale) {
  SheetLayout layout{};
  layout.width = width;
  layout.margin = scaled(56, scale);
  layout.gap = scaled(36, scale);
  layout.title_size = scaled(34, scale);
  layout.title_height = scaled(72, scale);
  layout.columns = columns;
  layout.cell_width = std::max(16, (width - 2 * layout.margin - (columns - 1) * layout.gap) / columns);
  layout.caption_size = std::clamp(layout.cell_width / 14, 9, scaled(26, scale));
  layout.caption_height = layout.caption_size * 3 / 2;
  const double height = layout.cell_width * proportion;
  layout.cell_height = std::max(1, static_cast<int>(std::lround(std::min<double>(height, kMaxHeight * layout.cell_width))));
  layout.picture_height = layout.cell_height;
  layout.picture_width = std::clamp(static_cast<int>(std::lround(layout.cell_height / proportion)), 1, layout.cell_width);
  const int rows = (cells + columns - 1) / columns;
  layout.height =
      2 * layout.margin + layout.title_height + rows * (layout.cell_height + layout.caption_height) + (rows - 1) * layout.gap;
  return layout;
}

/// 0 is best: far from the wanted proportion, or with places left empty in the last row, is worse.
double badness(const SheetLayout& layout, int cells) {
  const int positions = (cells + layout.columns - 1) / layout.columns * layout.columns;
  return std::abs(std::log(static_cast<double>(layout.width) / layout.height / kWantedProportion)) +
         static_cast<double>(positions - cells) / cells;
}

constexpr Colour kGround{250, 248, 243}, kPaper{255, 255, 255}, kFrame{214, 208, 196}, kInk{27, 38, 59}, kQuiet{120, 116, 108},
    kWarning{217, 72, 15};

/// The levels of a layer, its images added up.
Result<SheetImage> image_of_layer(const SheetRequest& request, std::size_t index, const ReadImage& read) {
  const SheetLayer& layer = request.layers[index];
  SheetImage all;
  for (const std::string& path : layer.paths) {
    Result<SheetImage> image = read(index, path);
    if (!image) return image;
    if (image->columns() != request.grid.columns() || image->rows() != request.grid.rows()) {
      return Error{Fault::kVerification,
                   fmt::format("{}: {} x {} pixels where the manifest says {} x {}; plan the layer again", path, image->columns(),
                               image->rows(), request.grid.columns(), request.grid.rows())};
    }
    if (&path == &layer.paths.front()) {
      all = std::move(*image);
      continue;
    }
    Levels before;
    std::swap(before, all.levels);
    add_levels(before, image->levels, all.levels);
  }
  if (const int found = highest(all.levels); found > request.maximum) {
    return Error{Fault::kVerification, fmt::format("{}: has pixels of {} drops, the job at most {}; plan the layer again",
                                                   layer.paths.front(), found, request.maximum)};
  }
  return all;
}

/// Calls use(index, image) for each layer, from several threads. The error is that of the first layer with one.
template <class Use>
Status for_each_image(const SheetRequest& request, const ReadImage& read, const Use& use) {
  MemoryGate gate(request.memory_bytes);
  std::mutex mutex;
  std::size_t first_wrong = request.layers.size();
  Error error;
  tbb::parallel_for(std::size_t{0}, request.layers.size(), [&](std::size_t index) {
    const auto pass = gate.enter(request.layers[index].bytes);
    const Result<SheetImage> image = image_of_layer(request, index, read);
    if (image) return use(index, *image);
    const std::lock_guard lock(mutex);
    if (index < first_wrong) {
      first_wrong = index;
      error = image.error();
    }
  });
  if (first_wrong < request.layers.size()) return error;
  return {};
}

/// `window` and a margin around it, within the bed. The whole bed if the window is empty.
PixelWindow with_margin(const PixelWindow& window, const PixelGrid& grid) {
  const PixelWindow bed{0, grid.columns(), 0, grid.rows()};
  if (window.empty()) return bed;
  // 4 % of the longer side in mm, at least 3 pixels.
  const double side =
      std::max(static_cast<double>(window.width()) / grid.x.dpi(), static_cast<double>(window.height()) / grid.y.dpi());
  const auto x = static_cast<std::uint32_t>(std::max(3.0, side * 0.04 * grid.x.dpi()));
  const auto y = static_cast<std::uint32_t>(std::max(3.0, side * 0.04 * grid.y.dpi()));
  return {window.left - std::min(window.left, x), std::min(bed.right, window.right + x), window.top - std::min(window.top, y),
          std::min(bed.bottom, window.bottom + y)};
}

Result<PixelWindow> shown_window(const SheetRequest& request, const ReadImage& read) {
  const PixelWindow bed{0, request.grid.columns(), 0, request.grid.rows()};
  if (request.whole_bed) return bed;
  std::mutex mutex;
  PixelWindow all;
  const Status status = for_each_image(request, read, [&](std::size_t, const SheetImage& image) {
    const PixelWindow window = image.planes.empty() ? window_of(image.levels.view()) : window_of(*image.planes.front());
    const std::lock_guard lock(mutex);
    all = joined(all, window);
  });
  if (!status) return status.error();
  return with_margin(all, request.grid);
}

std::string shown_size(const PixelWindow& window, const PixelGrid& grid) {
  const auto size = [](double pixels, double dpi) { return pixels * 25.4 / dpi; };
  return fmt::format("{:.1f} x {:.1f} mm", size(window.width(), grid.x.dpi()), size(window.height(), grid.y.dpi()));
}

/// The longest beginning of `line` that fits, with dots if it is cut.
std::string fitted(const std::string& line, int size, int width) {
  if (text_width(line, size) <= width) return line;
  std::size_t length = line.size();
  while (length > 0 && text_width(line.substr(0, length) + "...", size) > width) --length;
  return line.substr(0, length) + "...";
}

void draw_frame(Canvas& canvas, const SheetRequest& request, const SheetLayout& layout, int cell) {
  const int left = layout.cell_left(cell), top = layout.cell_top(cell);
  canvas.fill_box(left - 1, top - 1, layout.cell_width + 2, layout.cell_height + 2, kFrame);
  canvas.fill_box(left, top, layout.cell_width, layout.cell_height, kPaper);
  const SheetLayer& layer = request.layers[static_cast<std::size_t>(cell)];
  const int baseline = top + layout.cell_height + layout.caption_size * 5 / 4, size = layout.caption_size;
  const int remark_width = text_width(layer.remark, size), name_width = text_width(layer.name, size);
  canvas.text(left, baseline, size, fitted(layer.name, size, layout.cell_width), layer.warns ? kWarning : kInk);
  if (name_width + size / 2 + remark_width <= layout.cell_width) {
    canvas.text(left + layout.cell_width - remark_width, baseline, size, layer.remark, kQuiet);
  }
}

}  // namespace

SheetLayout layout_chart(int cells, const PixelWindow& window, const PixelGrid& grid, int width) {
  const double scale = std::clamp(width / kDesignWidth, kMinScale, kMaxScale);
  const double proportion =
      static_cast<double>(window.height()) / grid.y.dpi() * grid.x.dpi() / static_cast<double>(window.width());
  if (cells == 1) {
    const SheetLayout frame = with_columns(1, 1, proportion, width, scale);
    // A layer alone is not made larger than its pixels, but its caption needs some room.
    const int pixels = std::max(static_cast<int>(window.width()), scaled(640, scale));
    return with_columns(1, 1, proportion, std::min(width, pixels + 2 * frame.margin), scale);
  }
  SheetLayout best = with_columns(1, cells, proportion, width, scale);
  for (int columns = 2; columns <= cells; ++columns) {
    const SheetLayout layout = with_columns(columns, cells, proportion, width, scale);
    if (layout.cell_width * columns > width) break;
    if (badness(layout, cells) < badness(best, cells)) best = layout;
  }
  return best;
}

Result<Buffer<std::byte>> contact_sheet(const SheetRequest& request, const ReadImage& read) {
  const Result<PixelWindow> window = shown_window(request, read);
  if (!window) return window.error();
  const int cells = static_cast<int>(request.layers.size());
  const SheetLayout layout = layout_chart(cells, *window, request.grid, static_cast<int>(request.width));
  Canvas canvas(layout.width, layout.height, kGround);
  const std::string title = request.title + "   |   " + shown_size(*window, request.grid) + " shown";
  canvas.text(layout.margin, layout.margin + layout.title_size, layout.title_size,
              fitted(title, layout.title_size, layout.width - 2 * layout.margin), kInk);
  for (int cell = 0; cell < cells; ++cell) draw_frame(canvas, request, layout, cell);

  const Status status = for_each_image(request, read, [&](std::size_t index, const SheetImage& image) {
    Buffer<std::uint8_t> shares(static_cast<std::size_t>(layout.picture_width) * layout.picture_height);
    const auto width = static_cast<std::uint32_t>(layout.picture_width);
    if (image.planes.empty()) {
      box_coverage(image.levels.view(), request.maximum, *window, width, shares);
    } else {
      std::vector<const BitRows*> planes;
      for (const auto& plane : image.planes) planes.push_back(plane.get());
      box_coverage(planes, request.maximum, *window, width, shares);
    }
    const int cell = static_cast<int>(index);
    const int left = layout.cell_left(cell) + (layout.cell_width - layout.picture_width) / 2;
    canvas.paint(left, layout.cell_top(cell), layout.picture_width, shares, request.layers[index].warns ? kWarning : kInk);
  });
  if (!status) return status.error();
  return canvas.png();
}

}  // namespace lamina::view::picture
