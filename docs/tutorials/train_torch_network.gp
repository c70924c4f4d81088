# Draws the picture of train_torch_network.md from the text files:
#   gnuplot train_torch_network.gp
set terminal pngcairo size 800,400
set output "train_torch_network.png"
set xlabel "cell"
set xrange [0:63]
set yrange [-0.1:0.8]
set key top left
plot "train_torch_network.txt" using 1:2 with steps linewidth 2 title "truth", \
     "" using 1:3 with lines linewidth 2 title "what the camera sees", \
     "" using 1:4 with lines linewidth 2 title "the network's answer"
