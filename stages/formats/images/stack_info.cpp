#include "stages/formats/images/stack_info.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "stages/data/levels.h"
#include "stages/formats/images/image.h"
#include "stages/formats/images/numbered.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::read {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostWrong = 20;  // lines

struct ImagePlace {
  const std::string* path;
  std::uint64_t page;
  std::string name() const { return page == 0 ? one_line(*path) : fmt::format("{}: page at byte {}", one_line(*path), page); }
};

/// One image.
struct ImageLook {
  std::string wrong;  // why it cannot be read
  ImageKind kind;
  std::uint32_t columns = 0, rows = 0;
  double dpi_x = 0, dpi_y = 0;
  std::uint64_t set = 0, grey = 0, light = 0;  // light: sum of darkness, of 255
};

ImageLook look_at_image(const ImagePlace& place, int threshold) {
  ImageLook look;
  const auto refuse = [&](const Error& error) { return look.wrong = one_line(error.message), look; };
  auto kind = kind_of(*place.path, place.page);
  if (!kind) return refuse(kind.error());
  const auto image = dark_pixels(*place.path, threshold, place.page);
  if (!image) return refuse(image.error());
  look.kind = std::move(*kind);
  look.columns = image->runs.columns;
  look.rows = image->runs.view().rows();
  look.dpi_x = image->dpi_x;
  look.dpi_y = image->dpi_y;
  look.set = set_pixels(image->runs);
  look.light = 255 * look.set;
  if (look.kind.bits == 1) return look;
  Levels levels;
  if (const auto grey = nearest_levels(*place.path, {255, false, place.page}, levels); !grey) return refuse(grey.error());
  look.light = sum_of_levels(levels);
  for (std::size_t i = 0; i < levels.level.size(); ++i) {
    if (levels.level[i] < 255) look.grey += levels.change[2 * i + 1] - levels.change[2 * i];
  }
  return look;
}

/// What keeps an image from being a layer beside the first one.
std::string differs(const ImageLook& look, const StackInfo& first) {
  if (look.columns != first.columns || look.rows != first.rows)
    return fmt::format("{} x {} pixels, the first image has {} x {}", look.columns, look.rows, first.columns, first.rows);
  if (std::abs(look.dpi_x - first.dpi_x) > 0.05 || std::abs(look.dpi_y - first.dpi_y) > 0.05)
    return fmt::format("{:g} x {:g} dpi, the first image has {:g} x {:g}", look.dpi_x, look.dpi_y, first.dpi_x, first.dpi_y);
  return {};
}

void add_look(const ImagePlace& place, const ImageLook& look, StackInfo& info) {
  std::string wrong = look.wrong;
  if (!wrong.empty()) {
    ++info.unreadable;
  } else if (wrong = differs(look, info); !wrong.empty()) {
    ++info.differing;
    wrong = fmt::format("{}: {}", place.name(), wrong);
  }
  if (!wrong.empty() && info.wrong.size() < kMostWrong) info.wrong.push_back(std::move(wrong));
  if (!look.wrong.empty()) return;
  info.set += look.set;
  info.grey += look.grey;
  info.filled += static_cast<double>(look.light) / 255;
  info.empty += look.set == 0;
  info.least_set = std::min(info.least_set, look.set);
  info.most_set = std::max(info.most_set, look.set);
  // As long as all are of one kind it is told.
  if (look.kind.format != info.kind.format) info.kind.format = "several formats";
  if (look.kind.light != info.kind.light) info.kind.light = "0 is white in some";
  if (look.kind.coding != info.kind.coding) info.kind.coding = "several codings";
  info.kind.bits = std::max(info.kind.bits, look.kind.bits);
}

std::string ranges_text(const StackInfo& info) {
  std::string text;
  for (std::size_t i = 0; i < std::min(info.missing.size(), kMostWrong); ++i) {
    const auto [from, to] = info.missing[i];
    text += fmt::format("{}{}", i == 0 ? "" : ", ", from == to ? fmt::format("{}", from) : fmt::format("{} to {}", from, to));
  }
  return text + (info.missing.size() > kMostWrong ? ", ..." : "");
}

}  // namespace

std::uint64_t StackInfo::missing_numbers() const {
  std::uint64_t sum = 0;
  for (const auto& [from, to] : missing) sum += to - from + 1;
  return sum;
}

Result<StackInfo> look_at_stack(const std::string& path, int threshold) {
  StackInfo info;
  info.path = path;
  std::error_code ignored;
  info.folder = fs::is_directory(path, ignored);
  std::vector<Numbered> files{{0, path}};
  if (info.folder) {
    auto found = numbered_images(path, true);
    if (!found) return found.error();
    files = std::move(*found);
    info.first_number = files.front().number;
    info.last_number = files.back().number;
    for (std::size_t i = 1; i < files.size(); ++i) {
      if (files[i].number != files[i - 1].number + 1) info.missing.push_back({files[i - 1].number + 1, files[i].number - 1});
    }
  }
  info.files = files.size();
  std::vector<ImagePlace> places;
  for (const Numbered& file : files) {
    const auto pages = pages_of(file.path);
    if (!pages && info.files == 1) return pages.error();
    if (!pages) {
      places.push_back({&file.path, 0});  // says what is wrong when it is read
      continue;
    }
    for (const std::uint64_t page : *pages) places.push_back({&file.path, page});
    if (info.folder && pages->size() > 1)
      info.wrong.push_back(fmt::format("{}: holds {} images; name the file itself, or write one image a file",
                                       one_line(file.path), pages->size()));
  }
  info.images = places.size();
  std::vector<ImageLook> looks(places.size());
  tbb::parallel_for(std::size_t{0}, places.size(), [&](std::size_t i) { looks[i] = look_at_image(places[i], threshold); });
  const auto first = std::ranges::find_if(looks, [](const ImageLook& look) { return look.wrong.empty(); });
  if (first == looks.end()) return Error{Fault::kInput, looks.front().wrong};
  info.kind = first->kind;
  info.columns = first->columns;
  info.rows = first->rows;
  info.dpi_x = first->dpi_x;
  info.dpi_y = first->dpi_y;
  info.least_set = UINT64_MAX;
  for (std::size_t i = 0; i < looks.size(); ++i) add_look(places[i], looks[i], info);
  return info;
}

std::string as_text(const StackInfo& info) {
  std::string text = one_line(info.path) + "\n";
  const auto line = [&](std::string_view name, const std::string& what) { text += fmt::format("  {:<12}{}\n", name, what); };
  const std::string in = !info.folder && info.images > 1 ? " on pages of one file" : "";
  line("images", fmt::format("{} {}{}: {} bit{}, {}, coded {}", info.images, info.kind.format, in, info.kind.bits,
                             info.kind.bits > 1 ? "s" : "", info.kind.light, info.kind.coding));
  if (info.folder) {
    line("numbers",
         fmt::format("{} to {}{}", info.first_number, info.last_number,
                     info.missing.empty() ? "" : fmt::format("; {} missing: {}", info.missing_numbers(), ranges_text(info))));
  }
  const bool told = info.dpi_x > 0 && info.dpi_y > 0;
  line("size", fmt::format("{} x {} pixels{}", info.columns, info.rows,
                           told ? fmt::format(" of {:.6g} x {:.6g} dpi: {:.3f} x {:.3f} mm", info.dpi_x, info.dpi_y,
                                              info.columns * 25.4 / info.dpi_x, info.rows * 25.4 / info.dpi_y)
                                : "; the files tell no resolution"));
  line("set", fmt::format("{} pixels, {} to {} an image{}", readable_count(info.set), readable_count(info.least_set),
                          readable_count(info.most_set), info.empty > 0 ? fmt::format("; {} of them empty", info.empty) : ""));
  if (info.kind.bits > 1)
    line("grey", fmt::format("{} pixels between white and black; all come to {} full ones", readable_count(info.grey),
                             readable_count(static_cast<std::uint64_t>(std::llround(info.filled)))));
  for (const std::string& wrong : info.wrong) line("wrong", wrong);
  if (const std::uint64_t more = info.unreadable + info.differing; more > info.wrong.size())
    line("wrong", fmt::format("{} images in all", more));
  return text;
}

Json as_json(const StackInfo& info) {
  Json json = {{"path", info.path},
               {"kind", "images"},
               {"files", info.files},
               {"images", info.images},
               {"format", info.kind.format},
               {"bits", info.kind.bits},
               {"photometric", info.kind.light},
               {"compression", info.kind.coding},
               {"columns", info.columns},
               {"rows", info.rows},
               {"dpi", nullptr},
               {"set_pixels", info.set},
               {"least_set_pixels", info.least_set},
               {"most_set_pixels", info.most_set},
               {"empty_images", info.empty},
               {"grey_pixels", info.grey},
               {"filled_pixels", info.filled},
               {"unreadable_images", info.unreadable},
               {"differing_images", info.differing},
               {"wrong", info.wrong}};
  if (info.dpi_x > 0 && info.dpi_y > 0) json["dpi"] = {info.dpi_x, info.dpi_y};
  if (info.folder) json["numbers"] = {{"first", info.first_number}, {"last", info.last_number}, {"missing", info.missing}};
  return json;
}

}  // namespace lamina::read
