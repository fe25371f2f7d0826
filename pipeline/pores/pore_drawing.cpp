#include "pipeline/pores/pore_drawing.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "stages/pores/porosity.h"
#include "stages/segment/permeability.h"  // the unit
#include "stages/support/text/readable.h"
#include "stages/view/pore_picture.h"

namespace lamina::pipeline {
namespace {

/// The middle of the longest run along x in the middle slice; that of the box where there is none.
std::array<std::uint32_t, 3> widest_position(const VoxelView& set) {
  std::array<std::uint32_t, 3> position{set.nx / 2, set.ny / 2, set.nz / 2};
  std::uint32_t longest = 0;
  for (std::uint32_t y = 0; y < set.ny; ++y) {
    const auto row = set.row(y, position[2]);
    for (std::size_t i = 0; i < row.size(); i += 2) {
      if (row[i + 1] - row[i] <= longest) continue;
      longest = row[i + 1] - row[i];
      position[0] = row[i] + longest / 2;
      position[1] = y;
    }
  }
  return position;
}

std::string title_of(const std::string& source, const PoreReport& report, std::size_t axis) {
  const std::filesystem::path path = source;
  const std::string name = one_line((path.has_filename() ? path : path.parent_path()).filename().string());
  if (!report.section) {
    const bool requested = std::ranges::any_of(report.flow, [](const auto& darcy) { return darcy.has_value(); });
    return requested ? name + ": no void leads through" : name;
  }
  const Darcy& darcy = *report.flow[axis];
  return fmt::format("{}: k1 {:.4g} +- {:.2g} D along {} ({:.3e} m2)", name, darcy.k_m2[axis] / segment::kDarcy,
                     darcy.error_m2[axis] / segment::kDarcy, "xyz"[axis], darcy.k_m2[axis]);
}

std::string repeats_of(const std::array<bool, 3>& periodic) {
  std::string axes;
  for (std::size_t a = 0; a < 3; ++a)
    if (periodic[a]) axes += fmt::format("{}{}", axes.empty() ? "" : ", ", "xyz"[a]);
  return axes.empty() ? "repeats along no axis" : "repeats along " + axes;
}

/// Tops of layers, and the middles of beads of the one that is cut.
Status add_beads(const formats::GcodeFile& file, const Pile& pile, const WindowChoice& choice, view::PorePicture& picture) {
  const Box& box = choice.window.box;
  const double z = (picture.position[2] + 0.5) * mm(picture.solid.edge[2]);
  picture.solid_name = "beads";
  std::uint32_t cut = 0;
  for (std::uint32_t l = 0; l < choice.layers; ++l) {
    picture.layer_tops_mm.push_back(mm(pile.layers[choice.first_layer + l].high - box.lo.z));
    if (picture.layer_tops_mm.back() <= z) ++cut;
  }
  const Result<formats::GcodeLayer> layer =
      file.layer(pile.layers[choice.first_layer + std::min(cut, choice.layers - 1)].index);
  if (!layer) return layer.error();
  const auto apart = [](Nm a, Nm b, Nm low, Nm high) { return std::max(a, b) < low || std::min(a, b) > high; };
  for (const formats::GcodeBead& bead : layer->beads)
    if (!apart(bead.from.x, bead.to.x, box.lo.x, box.hi.x) && !apart(bead.from.y, bead.to.y, box.lo.y, box.hi.y))
      picture.lines.push_back({bead.from, bead.to});
  return {};
}

}  // namespace

Result<Plot> draw_window(const std::string& source, const WindowChoice& choice, const PoreReport& report,
                         const VoxelView& voxels, const formats::GcodeFile* file, const Pile* pile) {
  const int axis = report.section ? report.section->across.normal : 2;
  const VoxelStack through = pores::void_through(voxels, axis);
  view::PorePicture picture;
  picture.axis = axis;
  picture.solid = voxels;
  picture.through = through;
  if (report.section) {
    const stokes::Section& section = *report.section;
    picture.normal = section.along.normal;
    picture.across = &section.across;
    picture.along = &section.along;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::uint32_t finer = voxels.size()[a] / section.size[a];
      picture.position[a] = section.fastest[a] * finer + finer / 2;
    }
  } else {
    picture.position = widest_position(through);
  }
  const Box& box = choice.window.box;
  picture.corner_mm = {mm(box.lo.x), mm(box.lo.y), mm(box.lo.z)};
  if (file != nullptr && pile != nullptr)
    if (Status status = add_beads(*file, *pile, choice, picture); !status) return status.error();
  picture.title = title_of(source, report, static_cast<std::size_t>(axis));
  const auto& count = choice.window.count;
  picture.captions = {fmt::format(
      "window {:.3f} x {:.3f} x {:.3f} mm of {} x {} x {} voxels, {}; porosity {:.2f} %, {:.2f} % leads through along {}",
      mm(box.width()), mm(box.depth()), mm(box.height()), count[0], count[1], count[2], repeats_of(choice.window.periodic),
      100 * report.porosity.total(), 100 * report.porosity.percolating(axis), "xyz"[axis])};
  if (report.section)
    picture.captions.push_back(
        "creeping flow; mean: what flows / the whole cross-section, solid too (Darcy's velocity); ticks: where the sections cut each other");
  return view::draw_pores(picture);
}

}  // namespace lamina::pipeline
