// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/film.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>

#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/fed_program.h"
#include "evpose/io/files/new_folder.h"
#include "evpose/report/film_frames.h"
#include "evpose/report/run_pictures.h"

namespace evpose {
namespace {

/// Where the pictures go.
class FilmOutput {
 public:
  virtual ~FilmOutput() = default;
  virtual Status add(const RgbImage& image) = 0;
  virtual Status finish() = 0;
};

class PictureFolder : public FilmOutput {
 public:
  explicit PictureFolder(NewFolder folder) : folder_(std::move(folder)) {}
  Status add(const RgbImage& image) override {
    std::array<char, 40> name{};
    std::snprintf(name.data(), name.size(), "frame_%05zu.png", count_++);
    return write_text_file(folder_.path(name.data()), encode_png(image));
  }
  Status finish() override { return folder_.commit(); }

 private:
  NewFolder folder_;
  std::size_t count_ = 0;
};

class EncodedFilm : public FilmOutput {
 public:
  EncodedFilm(TemporaryFile file, FedProgram encoder)
      : file_(std::move(file)), encoder_(std::move(encoder)) {}
  Status add(const RgbImage& image) override { return encoder_.write(std::as_bytes(std::span(image.rgb))); }
  Status finish() override {
    if (auto status = encoder_.finish(); !status) return status;
    return file_.commit();
  }

 private:
  TemporaryFile file_;
  FedProgram encoder_;
};

/// The same pictures give the same bytes: no date, and a number of threads that is always the same.
std::vector<std::string> encoder_command(const FilmFrames& frames, double fps, bool gif,
                                         const std::string& path) {
  std::vector<std::string> out{"ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"};
  const auto add = [&](std::initializer_list<std::string> words) { out.insert(out.end(), words); };
  add({"-s", text(frames.width(), "x", frames.height()), "-r", text(fps), "-i", "-"});
  if (gif)
    add({"-filter_complex", "split[a][b];[a]palettegen=stats_mode=diff[p];[b][p]paletteuse=dither=none", "-f",
         "gif"});
  else
    add({"-c:v", "libx264", "-crf", "26", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"});
  add({"-threads", "2", "-fflags", "+bitexact", "-flags:v", "+bitexact", path});
  return out;
}

Expected<std::unique_ptr<FilmOutput>> open_output(const FilmRequest& request, const FilmFrames& frames) {
  const bool gif = request.output.ends_with(".gif");
  if (!gif && !request.output.ends_with(".mp4")) {
    auto folder = NewFolder::create(request.output, "frame_00000.png");
    if (!folder) return folder.error();
    return std::unique_ptr<FilmOutput>(new PictureFolder(*std::move(folder)));
  }
  auto file = TemporaryFile::create(request.output);
  if (!file) return file.error();
  auto encoder = FedProgram::start(encoder_command(frames, request.fps, gif, file->path()));
  if (!encoder)
    return Error{encoder.error().where, encoder.error().what,
                 encoder.error().fix + ", or name a folder: pictures go there"};
  return std::unique_ptr<FilmOutput>(new EncodedFilm(*std::move(file), *std::move(encoder)));
}

/// The updates that are shown, one for each picture: the last before its time.
std::vector<std::size_t> choose_rows(const RunFiles& run, const FilmRequest& request) {
  const TimeNs begin = run.rows.front().t + from_seconds(request.start_s);
  const double most_s = to_seconds(run.rows.back().t - begin);
  const double span_s = std::min(request.duration_s, most_s);
  std::vector<std::size_t> out;
  std::size_t row = 0;
  for (std::size_t k = 0;; ++k) {
    const double at_s = static_cast<double>(k) * request.speed / request.fps;
    if (at_s > span_s) return out;
    while (row + 1 < run.rows.size() && run.rows[row + 1].t <= begin + from_seconds(at_s)) ++row;
    out.push_back(row);
  }
}

}  // namespace

Expected<std::size_t> render_film(const FilmRequest& request) {
  const auto run = read_run_files(request.run);
  if (!run) return run.error();
  const auto rows = choose_rows(*run, request);
  if (rows.empty())
    return Error{"--start", text(request.start_s, " s lies after the end of the run"),
                 text("the run has ", to_seconds(run->rows.back().t - run->rows.front().t), " s")};
  auto map = read_run_map(*run);
  if (!map) return map.error();
  auto pictures = RunPictures::open(*run, *std::move(map));
  if (!pictures) return pictures.error();
  FilmFrames frames(*run, pictures->map(), pictures->size());
  auto output = open_output(request, frames);
  if (!output) return output.error();
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const auto overlay = pictures->draw(run->rows[rows[k]]);
    if (!overlay) return overlay.error();
    if (auto status = (*output)->add(frames.draw(*overlay, rows[k])); !status) return status.error();
    const double share = static_cast<double>(k + 1) / static_cast<double>(rows.size());
    if (request.progress && !request.progress(share)) return std::size_t{0};
  }
  if (auto status = (*output)->finish(); !status) return status.error();
  return rows.size();
}

}  // namespace evpose
