// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Draws with MuJoCo itself, in software: OSMesa needs neither a screen nor a graphics card.
#include <stdexcept>

#include "pictures.hpp"

#ifdef CLOSED_LOOP_RENDERER
#include <GL/osmesa.h>
#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#endif

namespace closed_loop {

#ifndef CLOSED_LOOP_RENDERER

bool can_render() { return false; }

constexpr const char* kNoRenderer = "built without a renderer: libosmesa6-dev and libpng-dev were missing";

void write_frames(const std::string& /*path*/, const std::vector<Recorded>& /*runs*/,
                  const std::vector<Time>& /*times*/) {
  throw std::runtime_error(kNoRenderer);
}

void write_movie(const std::string& /*folder*/, const std::vector<Recorded>& /*runs*/,
                 const std::vector<Time>& /*times*/) {
  throw std::runtime_error(kNoRenderer);
}

#else

namespace {

constexpr int kWidth = 400;
constexpr int kHeight = 300;
constexpr int kGap = 4;
constexpr std::size_t kBytes = 3;
constexpr std::size_t kChannels = 4;                                    // of MuJoCo's colours
constexpr std::array<float, kChannels> kDown = {0.85F, 0.1F, 0.1F, 1};  // the colour of a plant that has fallen

struct Image {
  int width = 0;
  int height = 0;
  std::vector<unsigned char> pixels;

  Image(int w, int h) : width(w), height(h), pixels(static_cast<std::size_t>(w * h) * kBytes, 255) {}

  void paste(const Image &other, int x, int y) {
    for (int row = 0; row < other.height; ++row) {
      const auto from = static_cast<std::size_t>(row * other.width) * kBytes;
      const auto to = static_cast<std::size_t>((y + row) * width + x) * kBytes;
      std::memcpy(&pixels[to], &other.pixels[from], static_cast<std::size_t>(other.width) * kBytes);
    }
  }

  void write(const std::string &path) const {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = static_cast<png_uint_32>(width);
    image.height = static_cast<png_uint_32>(height);
    image.format = PNG_FORMAT_RGB;
    if (png_image_write_to_file(&image, path.c_str(), 0, pixels.data(), 0, nullptr) == 0) {
      throw std::runtime_error(path + ": " + image.message);
    }
  }
};

class Renderer {
 public:
  explicit Renderer(const std::vector<PlantSpec> &plants)
      : model_(compile(mjcf(plants))),
        data_(mj_makeData(model_.get())),
        colours_(model_->geom_rgba, model_->geom_rgba + kChannels * static_cast<std::size_t>(model_->ngeom)),
        buffer_(kChannels * kWidth * kHeight) {
    gl_ = OSMesaCreateContextExt(OSMESA_RGBA, 24, 8, 0, nullptr);
    if (gl_ == nullptr || OSMesaMakeCurrent(gl_, buffer_.data(), GL_UNSIGNED_BYTE, kWidth, kHeight) == 0) {
      throw std::runtime_error("OSMesa gives no context to draw in");
    }
    mjv_defaultScene(&scene_);
    mjv_makeScene(model_.get(), &scene_, 1000);
    mjr_defaultContext(&context_);
    mjr_makeContext(model_.get(), &context_, mjFONTSCALE_100);
    mjr_setBuffer(mjFB_OFFSCREEN, &context_);
    mjv_defaultOption(&option_);
    mjv_defaultFreeCamera(model_.get(), &camera_);
    camera_.lookat[0] = 0;
    camera_.lookat[1] = 0.5;
    camera_.lookat[2] = 0.34;
    camera_.distance = 2.0;
    camera_.azimuth = 72;
    camera_.elevation = -17;
  }
  ~Renderer() {
    mjr_freeContext(&context_);
    mjv_freeScene(&scene_);
    OSMesaDestroyContext(gl_);
  }
  Renderer(const Renderer &) = delete;
  Renderer &operator=(const Renderer &) = delete;

  Image draw(const std::vector<PlantSpec> &plants, const std::vector<Snapshot> &snapshots, const std::string &title,
             const std::string &text) {
    int q = 0;
    for (std::size_t i = 0; i < plants.size(); ++i) {
      data_->qpos[q++] = snapshots[i].position;
      if (plants[i].kind == PlantSpec::Kind::Quadrotor) data_->qpos[q++] = snapshots[i].height;
      data_->qpos[q++] = snapshots[i].angle;
    }
    mj_forward(model_.get(), data_.get());
    paint(snapshots);
    const mjrRect view{0, 0, kWidth, kHeight};
    mjv_updateScene(model_.get(), data_.get(), &option_, nullptr, &camera_, mjCAT_ALL, &scene_);
    mjr_render(view, &scene_, &context_);
    mjr_overlay(mjFONT_NORMAL, mjGRID_TOPLEFT, view, title.c_str(), text.c_str(), &context_);
    Image upside_down(kWidth, kHeight);
    mjr_readPixels(upside_down.pixels.data(), nullptr, view, &context_);
    Image image(kWidth, kHeight);
    for (int row = 0; row < kHeight; ++row) {
      const auto bytes = static_cast<std::size_t>(kWidth) * kBytes;
      std::memcpy(&image.pixels[static_cast<std::size_t>(row) * bytes],
                  &upside_down.pixels[static_cast<std::size_t>(kHeight - 1 - row) * bytes], bytes);
    }
    return image;
  }

 private:
  // Every plant hangs on one child of the world, in the order of the plants.
  void paint(const std::vector<Snapshot> &snapshots) {
    std::copy(colours_.begin(), colours_.end(), model_->geom_rgba);
    int root = 0;
    auto plant = snapshots.begin() - 1;
    for (int geom = 0; geom < model_->ngeom; ++geom) {
      const int owner = model_->body_rootid[model_->geom_bodyid[geom]];
      if (owner == 0) continue;  // the floor and the rails
      if (owner != root) ++plant;
      root = owner;
      if (plant->down)
        std::copy(kDown.begin(), kDown.end(), model_->geom_rgba + kChannels * static_cast<std::size_t>(geom));
    }
  }

  Model model_;
  Data data_;
  std::vector<float> colours_;  // of all plants upright
  std::vector<unsigned char> buffer_;
  OSMesaContext gl_ = nullptr;
  mjvScene scene_{};
  mjrContext context_{};
  mjvOption option_{};
  mjvCamera camera_{};
};

Snapshot at(const std::vector<Snapshot> &snapshots, Time time) {
  const auto next =
      std::find_if(snapshots.begin(), snapshots.end(), [&](const Snapshot &snapshot) { return snapshot.time >= time; });
  if (snapshots.empty()) throw std::runtime_error("a plant without snapshots cannot be drawn");
  return next == snapshots.end() ? snapshots.back() : *next;
}

Image frame(Renderer &renderer, const std::vector<PlantSpec> &specs, const Recorded &run, Time time) {
  std::vector<Snapshot> snapshots;
  std::string text = fmt::format("{:.2f} s", static_cast<double>(time) / redag::kSecond);
  for (const PlantResult &plant : run.plants) {
    snapshots.push_back(at(plant.snapshots, time));
    if (snapshots.back().down) text += fmt::format("\n{} fell", plant.plant);
  }
  return renderer.draw(specs, snapshots, run.executor, text);
}

// Returns `columns` by `rows` scenes side by side.
Image grid(std::size_t columns, std::size_t rows, const std::function<Image(std::size_t, std::size_t)> &scene) {
  const auto across = static_cast<int>(columns);
  const auto down = static_cast<int>(rows);
  Image image(across * (kWidth + kGap) - kGap, down * (kHeight + kGap) - kGap);
  for (int row = 0; row < down; ++row) {
    for (int column = 0; column < across; ++column) {
      image.paste(scene(static_cast<std::size_t>(column), static_cast<std::size_t>(row)), column * (kWidth + kGap),
                  row * (kHeight + kGap));
    }
  }
  return image;
}

}  // namespace

bool can_render() { return true; }

void write_frames(const std::string &path, const std::vector<Recorded> &runs, const std::vector<Time> &times) {
  const std::vector<PlantSpec> specs = plants();
  Renderer renderer(specs);
  grid(times.size(), runs.size(), [&](std::size_t column, std::size_t row) {
    return frame(renderer, specs, runs[row], times[column]);
  }).write(path);
}

void write_movie(const std::string &folder, const std::vector<Recorded> &runs, const std::vector<Time> &times) {
  const std::vector<PlantSpec> specs = plants();
  Renderer renderer(specs);
  for (std::size_t i = 0; i < times.size(); ++i) {
    grid(runs.size(), 1, [&](std::size_t column, std::size_t) {
      return frame(renderer, specs, runs[column], times[i]);
    }).write(fmt::format("{}/{:04}.png", folder, i));
  }
}

#endif

}  // namespace closed_loop
