// A trained network, architecture and weights, in one text file that a program
// can load. `compare` writes it as network.txt beside the weights of each run.
//
//   invgrad network 1
//   widths 4 20 20 20 24
//   activation tanh
//   weights 1444
//   -0.26128751     one a line, in the order of dense_network.h, each with as
//   ...             many digits as give back the same double
//
// In numpy: np.loadtxt("network.txt", skiprows=4). Inputs and outputs have the
// units of the problem that the network was trained on.
//
// Cost:    20 bytes a weight.
// Fails:   returns false (nothing), with a message that names the file and the
//          error; *weights is then unchanged. ReadNetwork rejects truncated
//          files, inconsistent sizes and weights that are not finite, as after
//          diverged training; it never allocates more than a few times the
//          file's size. WriteNetwork CHECKs the number of weights.
#ifndef INVGRAD_NETWORK_FILE_H_
#define INVGRAD_NETWORK_FILE_H_

#include <optional>
#include <string>

#include "Eigen/Core"
#include "invgrad/dense_network.h"

namespace invgrad {

// Writes atomically (atomic_file.h), also weights that are not finite.
bool WriteNetwork(const std::string& path,
                  const DenseNetwork& network,
                  const Eigen::VectorXd& weights,
                  std::string* error);

std::optional<DenseNetwork> ReadNetwork(const std::string& path,
                                        Eigen::VectorXd* weights,
                                        std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_NETWORK_FILE_H_
