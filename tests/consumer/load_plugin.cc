// A program that knows nothing of invgrad and loads consumer, built as a shared
// object: load_plugin PLUGIN ARGUMENTS...
#include <dlfcn.h>

#include <cstdio>

int main(int argc, char** argv) {
  if (argc < 2) return 1;
  // As Python and plugin loaders open it.
  void* const plugin = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
  using Function = int (*)(int argc, char** argv, void* scope);
  const auto run =
      plugin == nullptr
          ? nullptr
          : reinterpret_cast<Function>(dlsym(plugin, "RunConsumer"));
  if (run == nullptr) {
    std::fprintf(stderr, "%s\n", dlerror());
    return 1;
  }
  return run(argc - 1, argv + 1, plugin);
}
