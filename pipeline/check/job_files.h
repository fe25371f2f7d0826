// pipeline/check/job_files.h: reads the files of a finished job back from its directory.
#pragma once

#include <string>
#include <vector>

#include "pipeline/check/expected_drops.h"
#include "pipeline/manifest/compare.h"
#include "pipeline/output/print_program.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/formats/images/image.h"
#include "stages/raster/images.h"
#include "stages/replay/machine.h"

namespace lamina::pipeline {

/// Of the program of a layer.
inline constexpr std::uint64_t kMaxProgramBytes = 4ull << 30;

/// The path of a part by its name, in folders (entries may also be files); empty: in none of them.
std::string find_part(const std::string& name, const std::vector<std::string>& folders);

/// The machine of program/machine.toml; it must match the manifest.
/// errors  kVerification: missing, changed, or of another job; begins with the file's path in the directory
Result<replay::VirtualMachine> machine_of_job(const std::string& directory, const ManifestHead& head);

/// The drops per pixel of a head that fires several, as planning reported them; "" for another head, or without its files.
std::string sweeps_of_job(const std::string& directory, const Manifest& manifest);

/// Compares the images of a layer with the manifest. errors  kVerification, with the file: missing, or another one
Status check_images(const std::string& directory, const ManifestHead& head, const LayerRecord& record);

/// Compares the programs before the first and after the last layer with the manifest. errors  the same
Status check_frame(const std::string& directory, const ManifestHead& head);

/// The text of a layer's print program. errors  kVerification, with the file: missing, damaged, or not that of the manifest
Result<std::string> program_of_layer(const std::string& directory, const ManifestHead& head, const LayerRecord& record);

/// The images of a layer's drops, of all materials, each within the one before; one where a pixel gets at most one drop.
using LayerPicture = std::vector<Runs>;

/// Whether a layer is one image of 1 bit.
bool is_one_bit(const ManifestHead& head);
/// Memory that reading the image of a layer takes at most, as file and decoded.
/// keep  of the image of a job that is_one_bit()
std::uint64_t bytes_to_read(const ManifestHead& head, const LayerRecord& record, Keep keep = Keep::kRuns);

/// The same with the drops that are made of it again, row by row.
std::uint64_t bytes_to_make(const ManifestHead& head, const LayerRecord& record);

/// Reads an image of a layer; its runs are the pixels with any drop.
/// keep    of images of 1 bit
/// drops   of a job whose images are grey drops: the pixels of each
/// levels  of grey images
/// errors  kVerification, with the file: of formats::image; more drops than the job has
Result<formats::Image> read_layer_image(const std::string& path, const ManifestHead& head, LayerPicture& drops, Levels& levels,
                                        Keep keep = Keep::kRuns);

/// What the images of a layer are put together by, and adds the one of this number.
/// errors  of DropPlanes::add()
raster::DropPlanes planes_of(const ManifestHead& head);
Status add_picture(const ManifestHead& head, std::size_t number, Runs&& image, LayerPicture&& drops,
                   raster::DropPlanes& picture);

/// A layer on the manifest's grid; at least one image.
/// errors  kVerification, with the file: of formats::image; wrong size; two materials in one pixel; drops without the first;
///         of ExpectedDrops::make
/// expected  the drops of an image of the geometry; as made for no job: images as they are
Result<LayerPicture> picture_of_layer(const std::string& directory, const ManifestHead& head, const LayerRecord& record,
                                      const ExpectedDrops& expected);

/// The pixels of a layer image, anywhere, that get any drop; of the geometry of a job, by its dose and machine.
/// errors  of formats::dark_pixels, check_images, ExpectedDrops::of and picture_of_layer
Result<formats::Image> printed_pixels(const std::string& image);

}  // namespace lamina::pipeline
