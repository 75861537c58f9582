// SPDX-License-Identifier: BSD-3-Clause
// The command line of `evpose bench`; the experiments are in src/evpose/bench/experiments.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <thread>

#include "commands.h"
#include "evpose/bench/experiments/calibration.h"
#include "evpose/bench/experiments/corner_repeatability.h"
#include "evpose/bench/experiments/edge_delays.h"
#include "evpose/bench/experiments/event_origins.h"
#include "evpose/bench/experiments/faults.h"
#include "evpose/bench/experiments/kidnapping.h"
#include "evpose/bench/experiments/published.h"
#include "evpose/bench/experiments/realtime.h"
#include "evpose/bench/experiments/relocalization.h"
#include "evpose/bench/experiments/residuals.h"
#include "evpose/bench/experiments/unseen/unseen.h"
#include "evpose/bench/experiments/update_picture.h"
#include "evpose/bench/experiments/variants.h"

namespace evpose {
namespace {

using Run = std::function<int()>;

int exit_status(const Status& status) { return status ? 0 : bad_input(status.error()); }

void add_settings(CLI::App& command, std::vector<std::string>& assignments) {
  command.add_option("--set", assignments, "one setting, key=value")->allow_extra_args(false);
}

void add_selection(CLI::App& command, experiments::Selection& selection) {
  command.add_option("folder", selection.folder, "folder with the recordings and maps")
      ->capture_default_str();
  command.add_option("--only", selection.only, "names of recordings")->delimiter(',');
  add_settings(command, selection.assignments);
}

/// Published sequences in place of our recordings.
void add_published(CLI::App& command, experiments::PublishedRequest& request) {
  const auto add = [&](const char* name, std::string& folder, const std::string& what) {
    auto* option = command.add_option(
        name, folder,
        "folder with " + what +
            " sequences, in place of our recordings: the paper's form and the defaults, from ground truth. "
            "Beside each its map or cloud, SEQUENCE_contours.ply or SEQUENCE_cloud.ply");
    for (const char* other : {"folder", "--recording", "--variant", "--only", "--set"})
      option->excludes(other);
  };
  add("--vector", request.vector, "VECtor");
  add("--tum-vie", request.tum_vie, "TUM-VIE");
  command.add_option("--maps", request.maps, "folder for the maps that are built of these clouds")
      ->capture_default_str();
}

void add_variants(CLI::App& bench, Run& run, const char* name, const char* what,
                  const std::vector<experiments::Variant>& variants, bool with_published = false) {
  auto* command = bench.add_subcommand(name, what);
  auto request = std::make_shared<experiments::VariantsRequest>();
  add_selection(*command, request->selection);
  command->add_option("--variant", request->begins, "how the names of variants begin that are wanted")
      ->delimiter(',');
  auto* own = command->add_option("--recording", request->own.folder,
                                  "a recording with truth, instead of the folder's");
  own->needs(command->add_option("--map", request->own.map, "map for --recording"));
  command->add_option("--occluders", request->own.occluders, "mesh that hides contours, for --recording")
      ->needs(own);
  auto published = std::make_shared<experiments::PublishedRequest>();
  if (with_published) add_published(*command, *published);
  command->callback([=, &run, &variants] {
    request->own.name = request->own.folder;
    if (!published->vector.empty() || !published->tum_vie.empty())
      run = [=] { return exit_status(experiments::print_published(*published)); };
    else
      run = [=, &variants] { return exit_status(experiments::print_variants(variants, *request)); };
  });
}

void add_calibration(CLI::App& bench, Run& run) {
  auto* command =
      bench.add_subcommand("calibration", "Time offset and camera pose found from a wrong calibration");
  auto selection = std::make_shared<experiments::Selection>();
  selection->only = {"room_people"};
  add_selection(*command, *selection);
  command->callback(
      [=, &run] { run = [=] { return exit_status(experiments::print_calibration(*selection)); }; });
}

void add_calibration_errors(CLI::App& bench, Run& run) {
  auto* command = bench.add_subcommand(
      "calibration-errors", "Accuracy with a wrong calibration, believed and with its errors as states");
  auto selection = std::make_shared<experiments::Selection>();
  auto draws = std::make_shared<int>(0);
  selection->only = {"room_spiral"};
  add_selection(*command, *selection);
  command->add_option("--draws", *draws, "sets of all errors of an ordinary calibration together")
      ->check(CLI::Range(0, 10000));
  command->callback([=, &run] {
    run = [=] { return exit_status(experiments::print_calibration_errors(*selection, *draws)); };
  });
}

void add_relocalization(CLI::App& bench, Run& run) {
  auto* command = bench.add_subcommand("relocalize", "Starts from wrong poses, and with wrong maps");
  auto request = std::make_shared<experiments::RelocalizationRequest>();
  add_selection(*command, request->selection);
  command->add_option("--seeds", request->seeds, "starts for each recording and class")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command->add_option("--threads", request->threads, "starts at a time")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  command
      ->add_option("--starts", request->classes,
                   "how the names of the wanted starts begin, as GPS,anywhere; wrong: what cannot be "
                   "tracked; default: all")
      ->delimiter(',');
  command->add_option("--within", request->within_s, "how long each start is watched, s")
      ->check(CLI::Range(0.1, 10.0));
  command->add_flag("!--no-imu", request->imu, "leave the IMU out");
  command->add_option("--looks", request->looks, "CSV file for what each update says of its pose");
  command->add_option("--map", request->selection.map, "of all of them, in place of their true contours");
  command->callback(
      [=, &run] { run = [=] { return exit_status(experiments::print_relocalization(*request)); }; });
}

void add_kidnapping(CLI::App& bench, Run& run) {
  auto* command = bench.add_subcommand("kidnap", "Live sessions whose data stop while the camera moves on");
  auto request = std::make_shared<experiments::KidnappingRequest>();
  add_selection(*command, request->selection);
  command->add_option("--seeds", request->seeds, "places of each recording")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command->add_option("--cut-s", request->cut_s, "data that are left out")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  command->add_option("--threads", request->threads, "places at a time")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  command->callback(
      [=, &run] { run = [=] { return exit_status(experiments::print_kidnapping(*request)); }; });
}

void add_event_origins(CLI::App& bench, Run& run) {
  auto* command = bench.add_subcommand("events", "Simulated recordings with the truth of each event");
  auto request = std::make_shared<experiments::EventOriginsRequest>();
  command->add_option("recordings", request->recordings, "folders made by `evpose simulate`")->required();
  command->add_option("--from", request->from_s, "seconds of the run that are left out")
      ->capture_default_str();
  add_settings(*command, request->assignments);
  command->callback(
      [=, &run] { run = [=] { return exit_status(experiments::print_event_origins(*request)); }; });
}

void add_corners(CLI::App& bench, Run& run) {
  auto* command = bench.add_subcommand(
      "corners", "How often corners in the events, and contours of the map, are seen again");
  auto selection = std::make_shared<experiments::Selection>();
  add_selection(*command, *selection);
  command->callback(
      [=, &run] { run = [=] { return exit_status(experiments::print_corner_repeatability(*selection)); }; });
}

void add_faults(CLI::App& bench, Run& run) {
  auto* command = bench.add_subcommand("faults", "Replays with faults in the streams");
  auto request = std::make_shared<experiments::FaultsRequest>();
  add_selection(*command, request->selection);
  command->add_option("--replays", request->replays, "number of replays")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command->add_option("--threads", request->threads, "replays at a time")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  command->add_option("--seed", request->seed, "of all random numbers")->capture_default_str();
  command->add_option("--fault", request->fault, "only the replays with this fault");
  command->add_option("--number", request->numbers, "only the replays of these numbers")->delimiter(',');
  command->add_flag("--each", request->each, "a line for each replay");
  command->callback([=, &run] {
    run = [=] {
      const auto not_finite = experiments::print_faults(*request);
      if (!not_finite) return bad_input(not_finite.error());
      return *not_finite > 0 ? 1 : 0;
    };
  });
}

void add_realtime(CLI::App& bench, Run& run) {
  auto* command = bench.add_subcommand(
      "realtime", "Speed and delay at high rates of events, from words of EVT3 to poses");
  auto request = std::make_shared<experiments::RealtimeRequest>();
  add_selection(*command, request->selection);
  command->add_option("--mev-s", request->rates_mev_s, "rates of events, with random ones added")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--updates", request->updates_hz, "updates a second")
      ->delimiter(',')
      ->capture_default_str();
  command->add_flag("--two-cores", request->two_cores,
                    "decode beside tracking, and clock by the wall; else processor time of one core");
  command->add_option("--burst", request->burst_mev_s, "million random events a second more, for 50 ms")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--beside-batch", request->beside_batch,
                    "each once more with events that are associated at the update, not as they come");
  command->add_option("--runs", request->runs, "of each; medians are told")
      ->check(CLI::Range(1, 99))
      ->capture_default_str();
  command->callback([=, &run] { run = [=] { return exit_status(experiments::print_realtime(*request)); }; });
}

void add_residuals(CLI::App& bench, Run& run) {
  auto* command = bench.add_subcommand("residuals", "Where events lie beside the contours of the true pose");
  auto request = std::make_shared<experiments::ResidualsRequest>();
  command->add_option("recording", request->recording.folder, "a recording with truth")->required();
  command->add_option("--map", request->recording.map, "contour map")->required();
  command->add_option("--occluders", request->recording.occluders, "mesh that hides contours");
  command->add_option("-o,--output", request->picture, "SVG file: offsets in the image and on the map");
  add_settings(*command, request->assignments);
  command->callback([=, &run] {
    request->recording.name = request->recording.folder;
    run = [=] { return exit_status(experiments::print_residuals(*request)); };
  });
}

void add_edge_delay(CLI::App& bench, Run& run) {
  auto* command = bench.add_subcommand("edge-delay",
                                       "A sensor's parameters of how late events come, from its recordings");
  auto request = std::make_shared<experiments::EdgeDelaysRequest>();
  command->add_option("recordings", request->recordings, "folders with truth, all of one sensor")->required();
  command
      ->add_option(
          "--map", request->maps,
          "contour map of all, or one for each; default: contours.ply and mesh.ply beside the events")
      ->allow_extra_args(false);
  command->add_option("--occluders", request->occluders, "mesh that hides contours, likewise")
      ->allow_extra_args(false);
  command->add_flag("--tracked", request->tracked, "from the poses that the tracker finds, without truth");
  add_settings(*command, request->assignments);
  command->callback(
      [=, &run] { run = [=] { return exit_status(experiments::print_edge_delays(*request)); }; });
}

void add_picture(CLI::App& bench, Run& run) {
  auto* command = bench.add_subcommand(
      "picture", "Draw one update: its events over the contours, by what became of them");
  auto request = std::make_shared<experiments::UpdatePictureRequest>();
  auto crop = std::make_shared<std::vector<double>>();
  command->add_option("recording", request->recording.folder, "a recording")->required();
  command->add_option("--map", request->recording.map, "contour map")->required();
  command->add_option("--occluders", request->recording.occluders, "mesh that hides contours");
  command->add_option("--at", request->at_s, "seconds of the run")->capture_default_str();
  command->add_option("--crop", *crop, "x y width height, px")->expected(4);
  command->add_option("-o,--output", request->output, "SVG file")->required();
  command->callback([=, &run] {
    if (crop->size() == 4) request->crop = {(*crop)[0], (*crop)[1], (*crop)[2], (*crop)[3]};
    run = [=] { return exit_status(experiments::draw_update(*request)); };
  });
}

void add_unseen(CLI::App& bench, Run& run) {
  auto* command =
      bench.add_subcommand("unseen",
                           "Places, flights and sensors drawn from seeds, tracked with true contours, a "
                           "built map and a handed-over "
                           "calibration. Seeds 0 to 99 are for development, those from 100 on for reporting");
  auto request = std::make_shared<experiments::UnseenRequest>();
  request->threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  command->add_option("--seeds", request->seeds, "number of seeds")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command->add_option("--from", request->from, "first of them")
      ->check(CLI::Range(0, 100000000))
      ->capture_default_str();
  command->add_option("--minutes", request->minutes, "after which no seed is begun; the same command goes on")
      ->check(CLI::Range(0.0, 1e6));
  command->add_option("-o,--output", request->output, "folder of the page and the results")
      ->capture_default_str();
  auto* keep = command->add_option("--keep", request->flights,
                                   "folder in which flights stay, and are taken from if they are there");
  command->add_flag("--rebuild-maps", request->rebuild_maps, "build the maps of kept flights anew")
      ->needs(keep);
  command->add_option("--known", request->known,
                      "results.jsonl of another run: its seeds are taken from there, and not flown");
  command->add_option("--compare", request->compare, "results.jsonl of another run: differences by seed");
  command->add_flag("--quick", request->quick, "320x240, 1 s and small clouds: to see that it works");
  command->add_option("--threads", request->threads, "seeds at a time; the result is the same for any number")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  add_settings(*command, request->assignments);
  command->callback([=, &run] { run = [=] { return exit_status(experiments::run_unseen(*request)); }; });
}

}  // namespace

void add_bench(CLI::App& app, std::function<int()>& run) {
  auto* bench = app.add_subcommand("bench", "Experiments on whole recordings: the tables of docs/results");
  bench->require_subcommand(1);
  add_variants(*bench, run, "fusion", "Back ends side by side", experiments::back_end_variants());
  add_variants(*bench, run, "ablation", "What each module of the tracker brings",
               experiments::ablation_variants());
  add_variants(*bench, run, "paper", "From the paper's form to the defaults, one replacement at a time",
               experiments::paper_variants(), true);
  add_calibration(*bench, run);
  add_calibration_errors(*bench, run);
  add_relocalization(*bench, run);
  add_kidnapping(*bench, run);
  add_corners(*bench, run);
  add_event_origins(*bench, run);
  add_faults(*bench, run);
  add_realtime(*bench, run);
  add_residuals(*bench, run);
  add_edge_delay(*bench, run);
  add_picture(*bench, run);
  add_unseen(*bench, run);
}

}  // namespace evpose
