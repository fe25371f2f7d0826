#include "stages/formats/voxels/image.h"

#include <fmt/format.h>

#include <array>

#include "stages/support/text/readable.h"

namespace lamina::formats::voxels {
namespace {

constexpr std::size_t kPiece = std::size_t{1} << 18;  // bytes that are handed over at once

std::string nrrd_head(const VoxelView& box, std::string_view version) {
  return fmt::format(
      "NRRD0005\n# {} {}\ntype: uint8\ndimension: 3\nspace dimension: 3\nsizes: {} {} {}\n"
      "space directions: ({},0,0) (0,{},0) (0,0,{})\nkinds: domain domain domain\nspace units: \"mm\" \"mm\" \"mm\"\n"
      "space origin: ({},{},{})\nencoding: raw\n\n",
      kMark, version, box.nx, box.ny, box.nz, mm(box.edge[0]), mm(box.edge[1]), mm(box.edge[2]), mm(box.edge[0]) / 2,
      mm(box.edge[1]) / 2, mm(box.edge[2]) / 2);
}

std::string meta_head(const VoxelView& box, std::string_view version) {
  return fmt::format(
      "ObjectType = Image\nNDims = 3\nComment = {} {}\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
      "CompressedData = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = {} {} {}\nCenterOfRotation = 0 0 0\n"
      "ElementSpacing = {} {} {}\nDimSize = {} {} {}\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n",
      kMark, version, mm(box.edge[0]) / 2, mm(box.edge[1]) / 2, mm(box.edge[2]) / 2, mm(box.edge[0]), mm(box.edge[1]),
      mm(box.edge[2]), box.nx, box.ny, box.nz);
}

/// Voxels are cells, so that edges of the box are those of the image.
std::string vti_head(const VoxelView& box, std::string_view version) {
  std::string text = fmt::format(
      "<?xml version=\"1.0\"?>\n<!-- {0} {1} -->\n"
      "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n"
      "<ImageData WholeExtent=\"0 {2} 0 {3} 0 {4}\" Origin=\"0 0 0\" Spacing=\"{5} {6} {7}\">\n"
      "<Piece Extent=\"0 {2} 0 {3} 0 {4}\">\n<CellData Scalars=\"set\">\n"
      "<DataArray type=\"UInt8\" Name=\"set\" format=\"appended\" offset=\"0\"/>\n"
      "</CellData>\n</Piece>\n</ImageData>\n<AppendedData encoding=\"raw\">\n_",
      kMark, version, box.nx, box.ny, box.nz, mm(box.edge[0]), mm(box.edge[1]), mm(box.edge[2]));
  const std::uint64_t bytes = box.voxels();
  text.append(reinterpret_cast<const char*>(&bytes), sizeof bytes);  // little-endian, as this program's hosts are
  return text;
}

}  // namespace

std::optional<ImageKind> image_kind(std::string_view path) {
  const std::string name = lower_case(std::string(path));
  if (name.ends_with(".nrrd")) return ImageKind::kNrrd;
  if (name.ends_with(".mha")) return ImageKind::kMeta;
  if (name.ends_with(".vti")) return ImageKind::kVti;
  return {};
}

Status write_image(File& file, const VoxelView& box, VoxelPhase side, ImageKind kind, std::string_view version) {
  const std::string head = kind == ImageKind::kNrrd   ? nrrd_head(box, version)
                           : kind == ImageKind::kMeta ? meta_head(box, version)
                                                      : vti_head(box, version);
  if (Status status = file.append(head); !status) return status;
  const std::size_t rows_at_once = std::max<std::size_t>(1, kPiece / std::max(1u, box.nx));
  Buffer<std::uint8_t> piece(std::min(rows_at_once, box.rows()) * box.nx);
  for (std::size_t first = 0; first < box.rows(); first += rows_at_once) {
    const std::size_t count = std::min(rows_at_once, box.rows() - first);
    const std::span<std::uint8_t> bytes = std::span(piece).first(count * box.nx);
    for (std::size_t r = 0; r < count; ++r) expand_row(box.row(first + r), side, bytes.subspan(r * box.nx, box.nx));
    if (Status status = file.append(std::as_bytes(bytes)); !status) return status;
  }
  return kind == ImageKind::kVti ? file.append(std::string_view("\n</AppendedData>\n</VTKFile>\n")) : Status();
}

}  // namespace lamina::formats::voxels
